//! Parsers from text to the one tree of `document`; each keeps the lines.

pub(super) mod ini;
pub(super) mod literal;
pub(super) mod toml;
pub(super) mod xml;
pub(super) mod yaml;
