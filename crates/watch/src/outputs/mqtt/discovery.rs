//! Announcements of each camera and target to Home Assistant: <https://www.home-assistant.io/integrations/mqtt/#mqtt-discovery>.

use super::link::Message;
use crate::names::Names;
use crate::outputs::said;
use crate::outputs::topics::Topics;
use serde_json::json;

/// Returns a sensor of the state for each pair, all of one device.
pub fn messages(prefix: &str, topics: &Topics, names: &Names) -> Vec<Message> {
    let n_targets = names.targets.len();
    let pairs = (0..names.cameras.len() * n_targets).map(|i| (i / n_targets, i % n_targets));
    let message = |(camera, target)| {
        let state = topics.state(camera, target);
        let id = identifier(&state);
        let config = json!({
            "name": names.pair(camera, target),
            "unique_id": id,
            "state_topic": state,
            "value_template": "{{ value_json.state }}",
            "json_attributes_topic": state,
            "availability_topic": topics.availability(),
            "device_class": "enum",
            "options": said::WORDS,
            "icon": "mdi:cctv",
            "device": {
                "identifiers": [identifier(&topics.availability())],
                "name": "Resight",
                "sw_version": env!("CARGO_PKG_VERSION"),
            },
        });
        Message::kept(format!("{prefix}/sensor/{id}/config"), config.to_string())
    };
    pairs.map(message).collect()
}

/// Returns an identifier. Home Assistant allows letters, digits, `_` and `-`; other letters are written by number, so that names stay distinct.
fn identifier(topic: &str) -> String {
    let letter = |c: char| match c {
        '/' => "_".to_string(),
        _ if c.is_ascii_alphanumeric() || c == '-' => c.to_string(),
        _ => format!("-{:x}", u32::from(c)),
    };
    format!("resight_{}", topic.chars().map(letter).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pair_is_announced_below_a_topic_of_its_own() {
        let of = |names: &[&str]| names.iter().map(|name| name.to_string()).collect();
        let names = Names { cameras: of(&["gate", "Tür"]), targets: of(&["a", "b"]) };
        let messages = messages("homeassistant", &Topics::new("site", &names), &names);
        let topics: Vec<&str> = messages.iter().map(|message| message.topic.as_str()).collect();
        assert_eq!(topics.len(), 4);
        assert_eq!(topics[0], "homeassistant/sensor/resight_site_gate_a_state/config");
        assert_eq!(topics[3], "homeassistant/sensor/resight_site_T-fcr_b_state/config");
        let config: serde_json::Value = serde_json::from_str(&messages[0].payload).expect("JSON");
        assert_eq!(
            (&config["state_topic"], &config["name"]),
            (&json!("site/gate/a/state"), &json!("gate/a"))
        );
    }
}
