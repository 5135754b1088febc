//! The header is that of the sources.

use std::path::Path;

/// Written anew with RESIGHT_BLESS=1.
#[test]
fn the_header_is_what_cbindgen_makes_of_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("cbindgen.toml");
    let bindings =
        cbindgen::Builder::new().with_src(folder.join("src/lib.rs")).with_config(config).generate();
    let mut made = Vec::new();
    bindings.expect("bindings").write(&mut made);
    let (made, path) = (String::from_utf8(made).expect("UTF-8"), folder.join("include/resight.h"));
    if std::env::var_os("RESIGHT_BLESS").is_some() {
        std::fs::write(&path, made).expect("written");
        return;
    }
    let committed = std::fs::read_to_string(&path).expect("the header");
    assert!(
        made == committed,
        "include/resight.h is not that of the sources; RESIGHT_BLESS=1 cargo test -p resight-c --test it header writes it"
    );
}
