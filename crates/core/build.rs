//! Tells the tests whether there are recordings: those that need them show as ignored where there are none. All crates build this file.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(recordings)");
    let is_set = |variable: &str| {
        println!("cargo::rerun-if-env-changed={variable}");
        std::env::var_os(variable).is_some()
    };
    if [is_set("RESIGHT_DATA"), is_set("RESIGHT_FRAMES")] == [true, true] {
        println!("cargo::rustc-cfg=recordings");
    }
}
