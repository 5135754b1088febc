//! Prometheus' text format, version 0.0.4.

/// A page of families of samples.
#[derive(Debug, Default)]
pub struct Page {
    text: String,
}

/// Names and values of a sample's labels.
pub type Labels<'a> = &'a [(&'a str, &'a str)];

impl Page {
    /// Starts a family; its samples follow.
    pub fn family(&mut self, name: &str, kind: &str, help: &str) {
        let help = help.replace('\\', "\\\\").replace('\n', "\\n");
        self.text += &format!("# HELP {name} {help}\n# TYPE {name} {kind}\n");
    }

    /// Writes a sample of the family started last. Infinities and NaN are written as the format requires.
    pub fn sample(&mut self, name: &str, labels: Labels<'_>, value: f64) {
        let labels: Vec<String> =
            labels.iter().map(|(name, value)| format!("{name}=\"{}\"", escaped(value))).collect();
        let labels = if labels.is_empty() { String::new() } else { format!("{{{}}}", labels.join(",")) };
        self.text += &format!("{name}{labels} {}\n", number(value));
    }

    /// Returns the text of the page.
    pub fn into_text(self) -> String {
        self.text
    }
}

/// Returns the value of a label as it is written between quotes.
fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

/// Returns a number in the syntax that Go reads.
pub fn number(value: f64) -> String {
    match value {
        _ if value.is_nan() => "NaN".to_string(),
        f64::INFINITY => "+Inf".to_string(),
        f64::NEG_INFINITY => "-Inf".to_string(),
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_and_numbers_are_escaped() {
        let mut page = Page::default();
        page.family("a_total", "counter", "one\\two\nthree");
        page.sample("a_total", &[("camera", "a\"b\\c\nd")], 1.0);
        page.sample("b", &[], f64::INFINITY);
        let wanted = "# HELP a_total one\\\\two\\nthree\n# TYPE a_total counter\n\
            a_total{camera=\"a\\\"b\\\\c\\nd\"} 1\nb +Inf\n";
        assert_eq!(page.into_text(), wanted);
        assert_eq!([number(f64::NAN), number(1e-7), number(0.25)], ["NaN", "0.0000001", "0.25"]);
    }
}
