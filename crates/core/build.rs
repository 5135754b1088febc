//! Tells the tests whether there are recordings: those that need them show as ignored where there are none. All crates build this file.

pub fn main() {
    println!("cargo::rustc-check-cfg=cfg(recordings)");
    println!("cargo::rerun-if-env-changed=RESIGHT_DATA");
    if std::env::var_os("RESIGHT_DATA").is_some() {
        println!("cargo::rustc-cfg=recordings");
    }
}
