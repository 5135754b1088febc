//! The description of the interface is complete and true: every route, its methods, and what is really answered.

use crate::client::{ask, get, post, server, session};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::Path;

const JSON: &str = "application/json";

fn description(place: SocketAddr) -> Value {
    get(place, "/openapi.json").json()
}

/// What the sources hand to `.route(`, and how often they hand it something that is no literal.
fn routes_in_sources(folder: &Path, found: &mut BTreeSet<String>, others: &mut usize) {
    for entry in std::fs::read_dir(folder).expect("sources") {
        let path = entry.expect("a file").path();
        if path.is_dir() {
            routes_in_sources(&path, found, others);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = std::fs::read_to_string(&path).expect("a source");
            for rest in text.split(".route(").skip(1) {
                match rest.trim_start().strip_prefix('"') {
                    Some(literal) => _ = found.insert(literal.split('"').next().expect("a path").to_owned()),
                    None => *others += 1,
                }
            }
        }
    }
}

/// Every route of the router is described with all its methods, and every described one exists.
#[test]
fn every_route_is_described_and_every_described_one_exists() {
    let place = server(None);
    let description = description(place);
    let described = description["paths"].as_object().expect("paths");
    let (mut routes, mut others) = (BTreeSet::new(), 0);
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    routes_in_sources(&sources, &mut routes, &mut others);
    assert_eq!(others, 1, "the page's files are the only routes from a table");
    routes.extend(["/", "/app.js", "/app.css"].map(str::to_owned));
    assert_eq!(routes, described.keys().cloned().collect());
    for (path, methods) in described {
        // A method that no route takes is answered with those that it does take. A WebSocket's route takes any.
        if methods["get"].get("x-messages").is_some() {
            assert_eq!(get(place, path).status, 400, "{path} wants an upgrade, and a query");
            continue;
        }
        let refused = ask(place, &format!("DELETE {path}"), &[], b"");
        assert_eq!(refused.status, 405, "{path}");
        let head = refused.head.to_ascii_lowercase();
        let allowed = head
            .lines()
            .find_map(|line| line.strip_prefix("allow: "))
            .unwrap_or_else(|| panic!("{path}: {head}"));
        let allowed: BTreeSet<&str> =
            allowed.split(',').map(str::trim).filter(|method| *method != "head").collect();
        assert_eq!(
            allowed,
            methods.as_object().expect("methods").keys().map(String::as_str).collect(),
            "{path}"
        );
    }
}

/// Every reference leads somewhere, and every schema is one.
#[test]
fn every_schema_is_there_and_valid() {
    let place = server(None);
    let description = description(place);
    let schemas = description["components"]["schemas"].as_object().expect("schemas");
    for part in description.to_string().split("#/components/schemas/").skip(1) {
        let name = part.split('"').next().expect("a name");
        assert!(schemas.contains_key(name), "{name}");
    }
    assert!(!description.to_string().contains("x-given"));
    for name in
        ["View", "Command", "LiveView", "RigView", "Replay", "ErrorObject", "EventObject", "PageMessage"]
    {
        assert!(schemas.contains_key(name), "{name}");
    }
    for schema in schemas.values() {
        assert!(jsonschema::meta::is_valid(schema), "{schema}");
    }
}

/// A query says what it needs: without that, the route refuses; with that alone, it does not.
#[test]
fn what_a_query_needs_is_needed() {
    let place = server(None);
    let description = description(place);
    let mut n_needed = 0;
    for (path, methods) in description["paths"].as_object().expect("paths") {
        for (method, operation) in methods.as_object().expect("methods") {
            let parameters = operation["parameters"].as_array().expect("parameters");
            let needed: Vec<&str> = parameters
                .iter()
                .filter(|one| one["required"] == true)
                .map(|one| one["name"].as_str().expect("a name"))
                .collect();
            if needed.is_empty() || operation.get("x-messages").is_some() {
                continue;
            }
            n_needed += 1;
            let request = format!("{} {path}", method.to_uppercase());
            let media = [("Content-Type", if path.ends_with("photograph") { "image/png" } else { JSON })];
            assert_eq!(ask(place, &request, &media, b"{}").status, 400, "{request}");
            let query = needed.iter().map(|name| format!("{name}=x")).collect::<Vec<_>>().join("&");
            let with = ask(place, &format!("{request}?{query}"), &media, b"{}");
            assert_eq!(with.status, 404, "{request}?{query}: what it names is not there");
        }
    }
    assert!(10 < n_needed, "{n_needed}");
}

/// The answer is as described.
fn must_fit(description: &Value, path: &str, method: &str, answer: &Value) {
    let schema = &description["paths"][path][method]["responses"]["200"]["content"][JSON]["schema"];
    assert!(schema.is_object(), "{method} {path} is not described as JSON");
    must_be(description, schema, &format!("{method} {path}"), answer);
}

/// It is as a schema of the description says.
pub fn must_be(description: &Value, schema: &Value, what: &str, answer: &Value) {
    let whole = json!({ "allOf": [schema], "components": description["components"] });
    let validator = jsonschema::draft202012::new(&whole).unwrap_or_else(|e| panic!("{what}: {e}"));
    let faults: Vec<String> = validator
        .iter_errors(answer)
        .map(|fault| format!("{}: {fault}", fault.instance_path()))
        .take(5)
        .collect();
    assert!(faults.is_empty(), "{what}: {faults:#?}");
}

#[test]
fn answers_are_as_described() {
    let place = server(None);
    let description = description(place);
    let opened = post(place, "/api/session", &json!({ "example": true })).json();
    must_fit(&description, "/api/session", "post", &opened);
    let id = opened["session"].as_str().expect("an id");
    let view = get(place, &format!("/api/session/view?session={id}")).json();
    must_fit(&description, "/api/session/view", "get", &view);
    let empty = get(place, &format!("/api/session/view?session={}", session(place))).json();
    must_fit(&description, "/api/session/view", "get", &empty);
    for command in [
        json!({ "kind": "undo" }),
        json!({ "kind": "redo" }),
        json!({ "kind": "put_point", "name": "Z", "u_px": 5.0, "v_px": 5.0 }),
        json!({ "kind": "set_sigma", "sigma_px": -1.0 }),
    ] {
        let body = json!({ "seq": 7, "command": command });
        let done = post(place, &format!("/api/session/command?session={id}"), &body).json();
        must_fit(&description, "/api/session/command", "post", &done);
    }
    must_fit(&description, "/api/rig", "post", &post(place, "/api/rig", &json!({ "example": true })).json());
    must_fit(
        &description,
        "/api/whisker",
        "post",
        &post(place, "/api/whisker", &json!({ "example": true })).json(),
    );
    let unsolved =
        json!({ "schema": 2, "status": "not_connected", "message": "m", "groups": [["a"], ["b"]] });
    let unsolved = json!({ "files": [{ "name": "a", "text": unsolved.to_string() }] });
    must_fit(&description, "/api/rig", "post", &post(place, "/api/rig", &unsolved).json());
    // And what is refused.
    let error = json!({ "allOf": [{ "$ref": "#/components/schemas/ErrorObject" }], "components": description["components"] });
    let validator = jsonschema::draft202012::new(&error).expect("a schema");
    for refused in [
        get(place, "/nothing"),
        get(place, "/api/live"),
        get(place, "/api/session"),
        post(place, "/api/rig", &json!(3)),
    ] {
        assert!(validator.is_valid(&refused.json()), "{}", refused.json());
    }
    // A schema that lets anything through would pass all of that.
    assert!(!validator.is_valid(&json!({ "error": {} })));
}
