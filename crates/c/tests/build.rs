//! Builds programs in C and C++ with the library, as it was installed below a prefix.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// What a static library of Rust needs besides, as in `resight.pc`.
const SYSTEM: [&str; 6] = ["-lgcc_s", "-lutil", "-lrt", "-lpthread", "-lm", "-ldl"];
/// Whatever the compiler can find, and what the program does wrong when it runs.
const STRICT: [&str; 4] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"];
pub const SANITIZED: [&str; 3] = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

#[derive(Clone, Copy)]
pub enum Library {
    Shared,
    Static,
}

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the root")
}

/// A folder for what a test makes.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c").join(name);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// What a command prints; it has to succeed.
pub fn run(command: &mut Command) -> String {
    let done = command.output().unwrap_or_else(|reason| panic!("{command:?}: {reason}"));
    let [out, err] = [&done.stdout, &done.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(done.status.success(), "{command:?}: {}\n{out}\n{err}", done.status);
    out
}

/// Whether there is such a program.
pub fn is_there(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|done| done.status.success())
}

/// The prefix below which the library is installed, once: cargo builds the libraries beside the test itself.
pub static PREFIX: LazyLock<PathBuf> = LazyLock::new(|| {
    let prefix = folder("prefix");
    let test = std::env::current_exe().expect("this program");
    run(Command::new(root().join("scripts/install_c.sh")).arg(&prefix).arg(test.parent().expect("a folder")));
    prefix
});

/// Compiles a program; its warnings are errors.
pub fn compiled(source: &Path, library: Library, flags: &[&str]) -> PathBuf {
    let is_c = source.extension().is_some_and(|ending| ending == "c");
    let (compiler, standard) = if is_c { ("cc", "-std=c11") } else { ("c++", "-std=c++17") };
    let name = source.file_name().expect("a name").to_string_lossy();
    let kind = match library {
        Library::Shared => "shared",
        Library::Static => "static",
    };
    let program = folder("programs").join(format!("{name}-{kind}"));
    let mut command = Command::new(compiler);
    command.arg(standard).args(STRICT).args(flags).arg("-I").arg(PREFIX.join("include")).arg(source);
    match library {
        Library::Shared => {
            let folder = PREFIX.join("lib");
            command.arg(format!("-L{}", folder.display())).arg(format!("-Wl,-rpath,{}", folder.display()));
            command.args(["-lresight_c", "-lm"]);
        }
        Library::Static => {
            command.arg(PREFIX.join("lib/libresight_c.a")).args(SYSTEM);
        }
    }
    run(command.arg("-o").arg(&program));
    program
}

/// The flags with which a program's memory is checked, where the compiler has them.
pub fn sanitizers() -> &'static [&'static str] {
    static FLAGS: LazyLock<bool> = LazyLock::new(|| {
        let source = folder("programs").join("empty.c");
        std::fs::write(&source, "int main(void) { return 0; }\n").expect("written");
        let program = source.with_extension("out");
        let built = Command::new("cc").args(SANITIZED).arg(&source).arg("-o").arg(&program).output();
        built.is_ok_and(|done| done.status.success())
            && Command::new(&program).output().is_ok_and(|done| done.status.success())
    });
    match *FLAGS {
        true => &SANITIZED,
        false => {
            println!("without sanitizers: this compiler has none");
            &[]
        }
    }
}
