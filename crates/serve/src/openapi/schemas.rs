//! Schemas of inputs and answers. A type that is both may look different: a key with a default may be omitted in the input, but is always in the
//! answer. The input is then called `NAMEGiven`.

use schemars::JsonSchema;
use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

const PLACE: &str = "#/components/schemas/";

pub(super) struct Schemas {
    answers: SchemaGenerator,
    given: SchemaGenerator,
}

impl Schemas {
    pub fn new() -> Self {
        let settings =
            || SchemaSettings::draft2020_12().with(|s| s.definitions_path = "/components/schemas".into());
        Schemas {
            answers: settings().for_serialize().into_generator(),
            given: settings().for_deserialize().into_generator(),
        }
    }

    /// Returns the schema of an answer.
    pub fn answer<T: JsonSchema>(&mut self) -> Value {
        self.answers.subschema_for::<T>().to_value()
    }

    /// Returns the schema of an input, marked so that `components` finds it.
    pub fn given<T: JsonSchema>(&mut self) -> Value {
        marked(self.given.subschema_for::<T>().to_value())
    }

    /// The parameters of a query with these keys of a type.
    pub fn query<T: JsonSchema>(&mut self, keys: &[&str]) -> Vec<Value> {
        let schema =
            SchemaSettings::draft2020_12().for_deserialize().into_generator().into_root_schema_for::<T>();
        let schema = schema.to_value();
        let required =
            |key: &str| schema["required"].as_array().is_some_and(|all| all.iter().any(|one| one == key));
        let parameter = |key: &&str| {
            let mut own = schema["properties"][*key].clone();
            let description = own.as_object_mut().and_then(|own| own.remove("description"));
            let mut parameter =
                json!({ "name": key, "in": "query", "required": required(key), "schema": not_null(own) });
            if let Some(description) = description {
                parameter["description"] = description;
            }
            parameter
        };
        keys.iter().map(parameter).collect()
    }

    /// Returns all schemas by name; references in `paths` are corrected.
    pub fn components(mut self, paths: &mut Map<String, Value>) -> Map<String, Value> {
        let mut all: Map<String, Value> = self.answers.take_definitions(true).into_iter().collect();
        let given: Map<String, Value> = self.given.take_definitions(true).into_iter().collect();
        let renamed = differing(&all, &given);
        for (name, mut schema) in given {
            rename(&mut schema, &renamed);
            let is_renamed = renamed.contains(&name);
            all.insert(if is_renamed { format!("{name}Given") } else { name }, schema);
        }
        paths.values_mut().for_each(|path| unmark(path, &renamed));
        all
    }
}

/// Names that mean something else coming in than going out; what refers to such a one differs too.
fn differing(answers: &Map<String, Value>, given: &Map<String, Value>) -> BTreeSet<String> {
    let mut found: BTreeSet<String> = BTreeSet::new();
    loop {
        let differs = |(name, schema): &(&String, &Value)| {
            answers.get(*name).is_some_and(|other| other != *schema || refers_to(schema, &found))
        };
        let now: BTreeSet<String> = given.iter().filter(differs).map(|(name, _)| name.clone()).collect();
        if now == found {
            return found;
        }
        found = now;
    }
}

fn refers_to(schema: &Value, names: &BTreeSet<String>) -> bool {
    match schema {
        Value::Object(keys) => {
            keys.iter().any(|(key, value)| match value.as_str().filter(|_| key == "$ref") {
                Some(place) => place.strip_prefix(PLACE).is_some_and(|name| names.contains(name)),
                None => refers_to(value, names),
            })
        }
        Value::Array(all) => all.iter().any(|one| refers_to(one, names)),
        _ => false,
    }
}

fn rename(schema: &mut Value, names: &BTreeSet<String>) {
    match schema {
        Value::Object(keys) => {
            for (key, value) in keys.iter_mut() {
                match value.as_str().filter(|_| key == "$ref").and_then(|place| place.strip_prefix(PLACE)) {
                    Some(name) if names.contains(name) => *value = json!(format!("{PLACE}{name}Given")),
                    _ => rename(value, names),
                }
            }
        }
        Value::Array(all) => all.iter_mut().for_each(|one| rename(one, names)),
        _ => {}
    }
}

const MARK: &str = "x-given";

fn marked(mut schema: Value) -> Value {
    schema[MARK] = json!(true);
    schema
}

fn unmark(value: &mut Value, names: &BTreeSet<String>) {
    match value {
        Value::Object(keys) => match keys.remove(MARK) {
            Some(_) => rename(value, names),
            None => keys.values_mut().for_each(|one| unmark(one, names)),
        },
        Value::Array(all) => all.iter_mut().for_each(|one| unmark(one, names)),
        _ => {}
    }
}

/// A query has no word for null: the parameter is left out.
fn not_null(mut schema: Value) -> Value {
    if let Some(types) = schema["type"].as_array() {
        let kept: Vec<&Value> = types.iter().filter(|one| *one != "null").collect();
        schema["type"] = if let [only] = kept[..] { only.clone() } else { json!(kept) };
    }
    schema
}
