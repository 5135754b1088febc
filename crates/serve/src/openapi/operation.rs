//! One operation of the description.

use serde_json::{Map, Value, json};

/// The operation of a method on a path.
pub(super) struct Operation {
    pub method: &'static str,
    pub path: &'static str,
    summary: &'static str,
    query: Vec<Value>,
    body: Map<String, Value>,
    answer: Map<String, Value>,
    messages: Option<Value>,
}

impl Operation {
    pub fn get(path: &'static str, summary: &'static str) -> Self {
        Operation::new("get", path, summary)
    }

    pub fn post(path: &'static str, summary: &'static str) -> Self {
        Operation::new("post", path, summary)
    }

    fn new(method: &'static str, path: &'static str, summary: &'static str) -> Self {
        let (body, answer) = (Map::new(), Map::new());
        Operation { method, path, summary, query: Vec::new(), body, answer, messages: None }
    }

    pub fn query(mut self, parameters: Vec<Value>) -> Self {
        self.query = parameters;
        self
    }

    pub fn takes(mut self, media_type: &str, schema: Value) -> Self {
        self.body.insert(media_type.to_owned(), json!({ "schema": schema }));
        self
    }

    pub fn takes_file(self, media_types: &[&str]) -> Self {
        media_types.iter().fold(self, |this, media_type| this.takes(media_type, binary()))
    }

    pub fn answers(mut self, media_type: &str, schema: Value) -> Self {
        self.answer.insert(media_type.to_owned(), json!({ "schema": schema }));
        self
    }

    pub fn answers_file(self, media_types: &[&str]) -> Self {
        media_types.iter().fold(self, |this, media_type| this.answers(media_type, binary()))
    }

    /// A WebSocket: what it takes and what it gives.
    pub fn upgrades(mut self, receives: Value, sends: Vec<Value>) -> Self {
        self.messages = Some(json!({ "receives": receives, "sends": { "anyOf": sends } }));
        self
    }

    /// Adds its binary messages: a description, and the schema of their headers.
    pub fn sends_binary(mut self, description: &str, header: Value) -> Self {
        if let Some(messages) = &mut self.messages {
            messages["binary"] = json!({ "description": description, "header": header });
        }
        self
    }

    /// Returns the OpenAPI object.
    pub fn object(self, error: &Value) -> Value {
        let mut responses = Map::new();
        match &self.messages {
            Some(_) => {
                let description = "The WebSocket is open; its messages are those of `x-messages`.";
                responses.insert("101".to_owned(), json!({ "description": description }))
            }
            None => {
                responses.insert("200".to_owned(), json!({ "description": "Done.", "content": self.answer }))
            }
        };
        let refusal = json!({ "application/json": { "schema": error } });
        responses
            .insert("default".to_owned(), json!({ "description": "What is wrong.", "content": refusal }));
        let mut one = json!({ "summary": self.summary, "parameters": self.query, "responses": responses });
        if !self.body.is_empty() {
            one["requestBody"] = json!({ "required": true, "content": self.body });
        }
        if let Some(messages) = self.messages {
            one["x-messages"] = messages;
        }
        one
    }
}

fn binary() -> Value {
    json!({ "type": "string", "format": "binary" })
}
