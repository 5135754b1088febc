//! The names of the solvers in flags and JSON.

use resight_core::locate::Method;

/// The solvers by their names in flags and JSON; `Priors`, `UnknownFocal` and `Lines` are chosen automatically only.
pub const METHODS: [(&str, Method); 7] = [
    ("auto", Method::Auto),
    ("wang2004", Method::Wang2004),
    ("line_plus_one", Method::LinePlusOne),
    ("p3p", Method::P3p),
    ("planar", Method::Planar),
    ("sqpnp", Method::Sqpnp),
    ("upright", Method::Upright),
];

/// Returns the name of a solver in flags and JSON.
pub fn method_name(method: Method) -> &'static str {
    let chosen_alone = match method {
        Method::Priors => "priors",
        Method::UnknownFocal => "unknown_focal",
        Method::Lines => "lines",
        _ => "auto",
    };
    METHODS.iter().find(|(_, known)| *known == method).map_or(chosen_alone, |(name, _)| name)
}
