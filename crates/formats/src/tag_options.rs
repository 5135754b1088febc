//! What a caller says of the tags of a map whose file does not state it.

use super::document::{Document, Fault};
use super::{Format, wpilib};
use crate::core::Target;

/// Family, size and tolerance of the tags of a map, for files that leave them out (WPILib's field layouts do).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TagOptions {
    /// Family of all tags.
    pub family: Option<String>,
    /// Outer edge of the black square of every tag, metres.
    pub size_m: Option<f64>,
    /// Standard deviation of each tag's position along each axis, metres.
    pub sigma_m: Option<f64>,
}

impl TagOptions {
    fn is_empty(&self) -> bool {
        *self == TagOptions::default()
    }
}

/// Puts the options where the file is silent; what is still assumed afterwards is returned as a warning.
///
/// Errors for a target that is no tag map, and for what the file states itself.
pub(super) fn apply(
    document: &Document,
    format: Format,
    target: &mut Target,
    options: &TagOptions,
) -> Result<Option<String>, Fault> {
    let kind = target.kind();
    let Target::TagMap(map) = target.design_mut() else {
        if options.is_empty() {
            return Ok(None);
        }
        return Err(Fault::new(format!(
            "--tag-family, --tag-size-m and --tag-sigma-m are for maps of tags; this target is of kind `{kind}` and states its own"
        )));
    };
    let root = document.entry();
    let in_tags = |key: &str| {
        let list = root.get("tag").and_then(|list| list.items().ok()).unwrap_or_default();
        list.iter().any(|tag| tag.has(key))
    };
    let states = |key: &str| root.has(key) || in_tags(key);
    let refuse = |flag: &str, key: &str| {
        Fault::new(format!("the file states `{key}` itself; leave out {flag}, or correct the file"))
    };
    if let Some(family) = &options.family {
        if states("family") {
            return Err(refuse("--tag-family", "family"));
        }
        map.family.clone_from(family);
    }
    if let Some(size_m) = options.size_m {
        if states("size_m") {
            return Err(refuse("--tag-size-m", "size_m"));
        }
        map.tags.iter_mut().for_each(|tag| tag.size_m = size_m);
    }
    if let Some(sigma_m) = options.sigma_m {
        if states("sigma_m") {
            return Err(refuse("--tag-sigma-m", "sigma_m"));
        }
        for tag in &mut map.tags {
            tag.sigma_m = sigma_m;
            // A map that is exact is so in every way.
            tag.sigma_rad = if sigma_m == 0.0 { 0.0 } else { tag.sigma_rad };
        }
    }
    let assumes_family = options.family.is_none() && !states("family");
    let assumes_size = options.size_m.is_none() && !states("size_m");
    if format != Format::WpilibLayout || !(assumes_family || assumes_size) {
        return Ok(None);
    }
    let mm = |x: f64| 1e3 * x;
    Ok(Some(match (assumes_family, assumes_size) {
        (true, true) => format!(
            "the layout states no tag size; {} with a black edge of {} mm is assumed (else give --tag-family and --tag-size-m)",
            wpilib::FAMILY,
            mm(wpilib::SIZE_M)
        ),
        (true, false) => {
            format!("the layout states no tag family; {} is assumed (else give --tag-family)", wpilib::FAMILY)
        }
        _ => format!(
            "the layout states no tag size; a black edge of {} mm is assumed (else give --tag-size-m)",
            mm(wpilib::SIZE_M)
        ),
    }))
}
