//! Writes a page that needs no network: text, tables and images in one file.

use super::verdict::Status;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;

/// A page under construction.
pub struct Page {
    title: String,
    style: String,
    top: String,
    body: String,
}

const STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:16px/1.55 system-ui,sans-serif;max-width:62rem;margin:2.5rem auto;padding:0 1.2rem;color:#1d232b;background:#fbfbf9}\
h1{font-size:1.9rem;margin:0 0 .3rem}h2{margin:2.4rem 0 .4rem;font-size:1.25rem}p{max-width:46rem}\
figure{margin:1rem 0}img{max-width:100%;height:auto;border-radius:6px;display:block}figcaption{color:#667;font-size:.9rem;margin-top:.3rem}\
.row{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(22rem,100%),1fr));gap:1rem}\
table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums;display:block;overflow-x:auto}\
th,td{text-align:left;padding:.35rem .9rem .35rem 0;border-bottom:1px solid #d9dbd6;white-space:nowrap}th{font-weight:600;color:#556}\
pre{background:#eff0ec;padding:.8rem 1rem;border-radius:6px;overflow-x:auto;font-size:.86rem}\
.verdict{font-size:1.15rem;margin:.2rem 0}\
.cards{display:flex;flex-wrap:wrap;gap:.4rem 2.4rem;margin:1rem 0}\
.cards div{margin:0}.cards dt{font-size:.85rem;color:#667}.cards dd{margin:0;font-size:1.2rem;font-variant-numeric:tabular-nums}\
.ok{color:#147a34}.weak,.ambiguous,.implausible{color:#9a6b00}.inconsistent,.error,.not_found,.degenerate{color:#b3261e}\
@media(prefers-color-scheme:dark){body{color:#e4e6e8;background:#16181b}pre{background:#22262b}th,td{border-color:#353a40}\
th,figcaption,.cards dt{color:#9aa3ad}.ok{color:#5ad67d}.weak,.ambiguous,.implausible{color:#f0c04a}.inconsistent,.error,.not_found,.degenerate{color:#ff8078}}\
@media(max-width:40rem){body{margin:1rem auto}.cards{gap:.4rem 1.2rem}pre{font-size:.72rem;padding:.6rem}}";

impl Page {
    /// Creates an empty page.
    pub fn new(title: &str) -> Self {
        Page { title: escaped(title), style: STYLE.into(), top: String::new(), body: String::new() }
    }

    /// Sets the beginning of the page, at any time: the status, a sentence, and the key figures with their names.
    pub fn verdict(&mut self, status: Status, sentence: &str, figures: &[(&str, String)]) -> &mut Self {
        self.top_of(status, status.name(), &status.name().to_uppercase().replace('_', " "), sentence, figures)
    }

    /// Sets the verdict of an answer that agrees with the data and whose figures are too uncertain for most uses.
    pub fn weak_verdict(&mut self, sentence: &str, figures: &[(&str, String)]) -> &mut Self {
        self.top_of(Status::Ok, "weak", "OK, WEAK", sentence, figures)
    }

    fn top_of(
        &mut self,
        status: Status,
        name: &str,
        word: &str,
        sentence: &str,
        figures: &[(&str, String)],
    ) -> &mut Self {
        let role = if status == Status::Ok { "" } else { " role=\"alert\"" };
        let figure = |(name, value): &(&str, String)| {
            format!("<div><dt>{}</dt><dd>{}</dd></div>", escaped(name), escaped(value))
        };
        self.top = format!(
            "<p class=\"verdict\"{role}><strong class=\"{name}\">{word}</strong> {}</p>\n<dl class=\"cards\">{}</dl>\n",
            escaped(sentence),
            figures.iter().map(figure).collect::<String>()
        );
        self
    }

    /// Adds a heading.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        self.push(format!("<h2>{}</h2>\n", escaped(text)))
    }

    /// Adds our own markup unchanged: every text in it must have been passed to `escaped`.
    pub fn markup(&mut self, markup: &str) -> &mut Self {
        self.push(format!("{markup}\n"))
    }

    /// Adds style rules to those of every page.
    pub fn style(&mut self, rules: &str) -> &mut Self {
        self.style.push_str(rules);
        self
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        self.push(format!("<p>{}</p>\n", escaped(text)))
    }

    /// Adds preformatted text.
    pub fn preformatted(&mut self, text: &str) -> &mut Self {
        self.push(format!("<pre>{}</pre>\n", escaped(text)))
    }

    /// Adds images side by side, each given as PNG bytes and a caption; they are embedded in the page.
    pub fn pictures(&mut self, pictures: &[(&[u8], &str)]) -> &mut Self {
        let figure = |(png, caption): &(&[u8], &str)| {
            let (data, caption) = (base64(png), escaped(caption));
            format!(
                "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
            )
        };
        self.push(format!("<div class=\"row\">{}</div>\n", pictures.iter().map(figure).collect::<String>()))
    }

    /// Adds a table; a cell that is a status word is coloured accordingly.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>]) -> &mut Self {
        let head: String = head.iter().map(|cell| format!("<th>{}</th>", escaped(cell))).collect();
        let cell = |text: &String| match STATUS_WORDS.contains(&text.as_str()) {
            true => format!("<td class=\"{text}\">{text}</td>"),
            false => format!("<td>{}</td>", escaped(text)),
        };
        let row = |cells: &Vec<String>| format!("<tr>{}</tr>\n", cells.iter().map(cell).collect::<String>());
        let rows: String = rows.iter().map(row).collect();
        self.push(format!("<table><thead><tr>{head}</tr></thead><tbody>\n{rows}</tbody></table>\n"))
    }

    /// Returns the whole document.
    pub fn html(&self) -> String {
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{}</title><style>{}</style></head>\n\
             <body>\n<h1>{}</h1>\n{}{}</body></html>\n",
            self.title, self.style, self.title, self.top, self.body
        )
    }

    fn push(&mut self, html: String) -> &mut Self {
        self.body.push_str(&html);
        self
    }
}

const STATUS_WORDS: [&str; 7] =
    ["ok", "ambiguous", "degenerate", "implausible", "inconsistent", "not_found", "error"];

/// Escapes text so that it is not interpreted as markup, in elements and in attributes between double quotes.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Encodes bytes in base64.
pub(crate) fn base64(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_become_markup() {
        let html = Page::new("a<b").paragraph("<script>\"&").html();
        assert!(
            !html.contains("<script>")
                && html.contains("a&lt;b")
                && html.contains("&lt;script&gt;&quot;&amp;")
        );
    }

    #[test]
    fn a_page_asks_nothing_of_the_network() {
        let html = Page::new("t").pictures(&[(b"png", "p")]).html();
        assert!(!html.contains("http") && !html.contains("<link") && !html.contains("<script"));
    }
}
