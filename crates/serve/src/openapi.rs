//! The description of the interface, generated from the types of its answers.

use crate::error::ErrorObject;
use crate::live::answers::{LiveView, LogLine, ReferenceView, StripView};
use crate::live::routes::{HistoryEvent, Named};
use crate::photograph::{Numbered, NumberedView, Open, Opened};
use crate::results::RigView;
use resight::scene::around::AroundScene;
use resight_session::View;
use schemars::JsonSchema;
use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde_json::{Map, Value, json};

/// One route: method, path, what it does, its query, its body and its answer.
struct Route {
    method: &'static str,
    path: &'static str,
    summary: &'static str,
    query: &'static [&'static str],
    body: Option<Value>,
    answer: Value,
}

/// The whole description, OpenAPI 3.1.
pub fn description() -> Value {
    let settings = SchemaSettings::draft2020_12().with(|s| s.definitions_path = "/components/schemas".into());
    let mut generator = settings.into_generator();
    let routes = routes(&mut generator);
    let error = schema::<ErrorObject>(&mut generator);
    let mut paths = Map::new();
    for route in routes {
        let one = operation(&route, &error);
        let path = paths.entry(route.path).or_insert_with(|| json!({}));
        path[route.method] = one;
    }
    let schemas: Map<String, Value> = generator.take_definitions(true).into_iter().collect();
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "Resight",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "Everything the page of `resight serve` does. Errors are {\"error\": {\"kind\", \"message\"}}. WebSockets: /ws/session?session=ID takes {seq, photo, command} and gives {seq, view}; /ws/live gives events, states and pictures."
        },
        "paths": paths,
        "components": { "schemas": schemas, "securitySchemes": { "token": { "type": "http", "scheme": "bearer" } } }
    })
}

fn schema<T: JsonSchema>(generator: &mut SchemaGenerator) -> Value {
    generator.subschema_for::<T>().to_value()
}

fn operation(route: &Route, error: &Value) -> Value {
    let parameter = |name: &&str| json!({ "name": name, "in": "query", "required": *name == "session", "schema": { "type": "string" } });
    let mut one = json!({
        "summary": route.summary,
        "parameters": route.query.iter().map(parameter).collect::<Vec<_>>(),
        "responses": { "200": route.answer, "default": content("application/json", error, "What is wrong.") }
    });
    if let Some(body) = &route.body {
        one["requestBody"] = body.clone();
    }
    one
}

fn content(media_type: &str, schema: &Value, description: &str) -> Value {
    json!({ "description": description, "content": { media_type: { "schema": schema } } })
}

fn routes(generator: &mut SchemaGenerator) -> Vec<Route> {
    let view = content("application/json", &schema::<View>(generator), "What is so now.");
    let opened = content("application/json", &schema::<Opened>(generator), "A session and its view.");
    let numbered =
        content("application/json", &schema::<NumberedView>(generator), "What is so after the command.");
    let rig = content("application/json", &schema::<RigView>(generator), "What a 3-D view needs.");
    let live = content("application/json", &schema::<LiveView>(generator), "How the cameras are.");
    let camera = content("application/json", &schema::<Named>(generator), "Which camera.");
    let history =
        content("application/json", &schema::<Vec<HistoryEvent>>(generator), "Events, oldest first.");
    let strip = content("application/json", &schema::<StripView>(generator), "A stretch of time in few parts.");
    let references =
        content("application/json", &schema::<Vec<ReferenceView>>(generator), "By target.");
    let scene = content("application/json", &schema::<Vec<AroundScene>>(generator), "By target.");
    let log = content("application/json", &schema::<Vec<LogLine>>(generator), "The last 200 lines, oldest first.");
    let binary = json!({ "type": "string", "format": "binary" });
    let file = content("application/octet-stream", &binary, "The file.");
    let any = json!({ "type": "object" });
    let object = content("application/json", &any, "As described in the book.");
    let open = content("application/json", &schema::<Open>(generator), "What to open.");
    let command = content("application/json", &schema::<Numbered>(generator), "A command.");
    let image =
        json!({ "content": { "image/jpeg": { "schema": binary }, "image/png": { "schema": binary } } });
    let json_body = content("application/json", &any, "JSON.");
    let get = |path, summary, query, answer: &Value| Route {
        method: "get",
        path,
        summary,
        query,
        body: None,
        answer: answer.clone(),
    };
    let post = |path, summary, query, body: &Value, answer: &Value| Route {
        method: "post",
        path,
        summary,
        query,
        body: Some(body.clone()),
        answer: answer.clone(),
    };
    vec![
        post("/api/session", "Opens a session: empty, saved or the example.", &[], &open, &opened),
        post("/api/session/photograph", "Adds a photograph.", &["session", "name"], &image, &view),
        get("/api/session/photograph", "A photograph as it came.", &["session", "photo"], &file),
        post("/api/session/command", "Applies a command.", &["session"], &command, &numbered),
        get("/api/session/view", "What is so now.", &["session", "photo"], &view),
        get(
            "/api/session/save",
            "The session as one file, which `resight measure` reads too.",
            &["session"],
            &file,
        ),
        get("/api/session/export", "The answer in another format.", &["session", "photo", "format"], &file),
        get("/api/session/birdseye", "The ground from straight above, PNG.", &["session", "photo"], &file),
        post("/api/rig", "A rig's answer as a 3-D view needs it.", &[], &json_body, &rig),
        get("/api/live", "How every watched camera is.", &[], &live),
        post("/api/live/acknowledge", "Acknowledges an alarm.", &[], &camera, &live),
        post("/api/live/reset", "Begins the standard deviations anew.", &[], &camera, &live),
        post(
            "/api/live/reference",
            "Learns a camera's reference anew; the old one is kept.",
            &[],
            &camera,
            &live,
        ),
        get("/api/live/reference", "What a camera is compared with.", &["camera"], &references),
        get(
            "/api/live/strip",
            "States and rotations of a camera: of the last day, or of a stretch.",
            &["camera", "from_s", "to_s", "bins"],
            &strip,
        ),
        get("/api/live/scene", "The cameras around each target.", &[], &scene),
        get("/api/live/log", "What happened.", &[], &log),
        get("/api/live/frame", "The next frame of a camera, PNG.", &["camera"], &file),
        get(
            "/api/live/history",
            "Events of a camera from the history file.",
            &["camera", "from_s", "to_s"],
            &history,
        ),
        get("/cameras.mjpg", "A camera as motion JPEG.", &["camera"], &file),
        get("/healthz", "Whether the server is well.", &[], &object),
    ]
}
