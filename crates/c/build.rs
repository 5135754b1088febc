//! Names the shared library for the programs that are linked with it: of a version 0.x each second number is another interface.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let of_package = |key: &str| std::env::var(format!("CARGO_PKG_VERSION_{key}")).unwrap_or_default();
    let (major, minor) = (of_package("MAJOR"), of_package("MINOR"));
    match std::env::var("CARGO_CFG_TARGET_OS").as_deref() {
        Ok("linux" | "freebsd") => {
            println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libresight_c.so.{major}.{minor}");
        }
        Ok("macos") => {
            println!(
                "cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libresight_c.{major}.{minor}.dylib"
            );
        }
        _ => {}
    }
}
