//! The examples in C and C++ build without a warning and run.

use crate::build::{Library, PREFIX, compiled, folder, is_there, root, run};
use std::process::Command;

fn says(printed: &str) {
    for line in ["four points: ", "photograph: "] {
        assert!(printed.contains(line), "{printed}");
    }
}

#[test]
fn examples_build_with_either_library_and_run() {
    for (source, library) in
        [("poses.c", Library::Shared), ("poses.c", Library::Static), ("poses.cpp", Library::Shared)]
    {
        let program = compiled(&root().join("crates/c/examples").join(source), library, &[]);
        says(&run(Command::new(program).current_dir(root())));
    }
}

/// The page of the book shows a part of the example as it is.
#[test]
fn the_page_shows_the_example() {
    let read = |file: &str| std::fs::read_to_string(root().join(file)).expect("a text");
    let (page, program) = (read("docs/c.md"), read("crates/c/examples/poses.c"));
    let shown = page.split("```c\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a block");
    assert!(10 < shown.lines().count() && program.contains(shown), "{shown}");
}

/// What `pkg-config` says is all that a compiler needs.
#[test]
fn examples_build_as_pkg_config_says() {
    if !is_there("pkg-config") {
        return println!("skipped: there is no pkg-config");
    }
    let libraries = PREFIX.join("lib/pkgconfig");
    let flags = run(Command::new("pkg-config")
        .args(["--cflags", "--libs", "resight"])
        .env("PKG_CONFIG_PATH", libraries));
    let program = folder("programs").join("poses-pkg-config");
    let source = root().join("crates/c/examples/poses.c");
    run(Command::new("cc").arg(source).args(flags.split_whitespace()).arg("-lm").arg("-o").arg(&program));
    says(&run(Command::new(program).current_dir(root()).env("LD_LIBRARY_PATH", PREFIX.join("lib"))));
}

#[test]
fn examples_build_with_cmake() {
    if !is_there("cmake") || !is_there("pkg-config") {
        return println!("skipped: there is no cmake, or no pkg-config");
    }
    let built = folder("cmake");
    let source = root().join("crates/c/examples");
    let prefix = format!("-DCMAKE_PREFIX_PATH={}", PREFIX.display());
    run(Command::new("cmake").arg("-S").arg(source).arg("-B").arg(&built).arg(prefix));
    run(Command::new("cmake").arg("--build").arg(&built));
    for program in ["poses", "poses_cpp"] {
        says(&run(Command::new(built.join(program)).current_dir(root())));
    }
}
