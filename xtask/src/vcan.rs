//! A session on a genuine CAN bus of Linux: virtual interfaces inside an emulated machine that runs Debian's kernel.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::shell::{Step, cargo, skip};

/// What the guest runs: Linux without any library.
const TARGET: &str = "x86_64-unknown-linux-musl";
/// Programs that are needed here, and the packages that have them.
const TOOLS: [(&str, &str); 6] = [
    ("qemu-system-x86_64", "qemu-system-x86"),
    ("busybox", "busybox-static"),
    ("cpio", "cpio"),
    ("xz", "xz-utils"),
    ("candump", "can-utils"),
    ("cansend", "can-utils"),
];
/// Seconds after which the guest is stopped.
const PATIENCE_S: &str = "600";
/// Sessions are in real time, and drives stop when the machine that emulates them stalls: that is tried again.
const ATTEMPTS: u32 = 3;
/// What the guest writes last.
const ENDED: &str = "the guest has ended";

/// Boots the guest, lets the session happen, and judges what has come of it.
pub(crate) fn run(root: &Path) -> Step {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        skip("real bus", "the guest needs Linux on x86-64");
        return Ok(());
    }
    if let Err(reason) = tools().and_then(|()| target()) {
        skip("real bus", &reason);
        return Ok(());
    }
    let cache = root.join("target/vcan");
    fs::create_dir_all(&cache).map_err(|e| format!("{}: {e}", cache.display()))?;
    let fetched =
        Command::new("sh").args(["-c", include_str!("vcan/kernel.sh"), "kernel"]).arg(&cache).status();
    if !fetched.is_ok_and(|status| status.success()) {
        skip("real bus", "no kernel with CAN could be fetched: apt-get download linux-image-amd64");
        return Ok(());
    }
    cargo(root, &["build", "--release", "--locked", "--target", TARGET, "--package", "cli"])?;
    let image = cache.join("guest.cpio");
    pack(&root.join("target").join(TARGET).join("release/feedspline"), root, &cache, &image)?;
    let out = cache.join("out");
    let mut result = Ok(());
    for attempt in 1..=ATTEMPTS {
        result = session(root, &cache, &image, &out);
        match &result {
            Ok(()) => break,
            Err(message) => eprintln!("session {attempt} of at most {ATTEMPTS}: {message}"),
        }
    }
    result
}

/// One session, and its judge.
fn session(root: &Path, cache: &Path, image: &Path, out: &Path) -> Step {
    boot(cache, image, out)?;
    let out = out.display().to_string();
    let judge = ["run", "--quiet", "--locked", "--package", "tests", "--example", "bus_session", "--", &out];
    cargo(root, &judge)
}

fn is_there(program: &str) -> bool {
    Command::new("sh")
        .args(["-c", &format!("command -v {program}")])
        .stdout(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

/// Whether all programs are there, or could be fetched.
fn tools() -> Result<(), String> {
    let missing = || TOOLS.iter().filter(|(program, _)| !is_there(program));
    if missing().next().is_none() {
        return Ok(());
    }
    let packages: Vec<&str> = missing().map(|(_, package)| *package).collect();
    let words = packages.join(" ");
    eprintln!("$ apt-get install {words}");
    let apt = |args: &[&str]| Command::new("apt-get").args(args).status().is_ok_and(|s| s.success());
    if apt(&["update", "-qq"])
        && apt(&[&["install", "-y", "-qq", "--no-install-recommends"][..], &packages].concat())
        && missing().next().is_none()
    {
        Ok(())
    } else {
        Err(format!("it needs {words}: apt-get install {words}"))
    }
}

/// Whether the target is there, or could be fetched.
fn target() -> Result<(), String> {
    let added = Command::new("rustup").args(["target", "add", TARGET]).status();
    if added.is_ok_and(|s| s.success()) {
        Ok(())
    } else {
        Err(format!("no {TARGET}: rustup target add {TARGET}"))
    }
}

/// Puts together what the guest finds when it starts.
fn pack(program: &Path, root: &Path, cache: &Path, image: &Path) -> Step {
    let folder = cache.join("guest");
    let fail = |what: &Path| {
        let name = what.display().to_string();
        move |e: std::io::Error| format!("{name}: {e}")
    };
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(fail(&folder))?;
    }
    let put = |from: &Path, to: &str| {
        let to = folder.join(to);
        let parent = to.parent().unwrap_or(&folder);
        fs::create_dir_all(parent).and_then(|()| fs::copy(from, &to)).map(drop).map_err(fail(from))
    };
    let write = |to: &str, text: &str| {
        let to = folder.join(to);
        fs::write(&to, text).map_err(fail(&to))
    };
    put(program, "bin/feedspline")?;
    put(&root.join("jobs/mill3.toml"), "machine.toml")?;
    for module in ["can", "can-raw", "can-dev", "vcan"] {
        put(&cache.join(module).with_extension("ko"), &format!("modules/{module}.ko"))?;
    }
    for tool in ["busybox", "candump", "cansend"] {
        let (path, libraries) = with_libraries(tool)?;
        put(&path, &format!("bin/{tool}"))?;
        for library in libraries {
            put(&library, library.display().to_string().trim_start_matches('/'))?;
        }
    }
    write("part.ngc", include_str!("vcan/part.ngc"))?;
    write("session.sh", include_str!("vcan/session.sh"))?;
    write("init", include_str!("vcan/init.sh"))?;
    let script = r#"cd "$1" && chmod 755 init bin/* && find . | cpio --quiet -o -H newc > "$2""#;
    let packed = Command::new("sh").args(["-c", script, "pack"]).args([folder.as_path(), image]).status();
    if packed.is_ok_and(|s| s.success()) { Ok(()) } else { Err("the guest cannot be packed".into()) }
}

/// Where a program is, and the libraries it loads.
fn with_libraries(program: &str) -> Result<(PathBuf, Vec<PathBuf>), String> {
    let said = |command: &mut Command| {
        let output = command.output().map_err(|e| format!("{program}: {e}"))?;
        Ok::<_, String>(String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let path = said(Command::new("sh").args(["-c", &format!("command -v {program}")]))?;
    let path = PathBuf::from(path.trim());
    // A static program has none, which ldd calls a failure.
    let loaded = said(Command::new("ldd").arg(&path))?;
    let libraries = loaded.split_ascii_whitespace().filter(|word| word.starts_with('/')).map(PathBuf::from);
    Ok((path, libraries.filter(|library| library.exists()).collect()))
}

/// Runs the guest to its end; what it leaves comes into `out`.
fn boot(cache: &Path, image: &Path, out: &Path) -> Step {
    let (console, results) = (cache.join("console"), cache.join("out.tgz"));
    for old in [&console, &results] {
        let _ = fs::remove_file(old);
    }
    if out.exists() {
        fs::remove_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
    }
    fs::create_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
    eprintln!("$ qemu-system-x86_64 -kernel vmlinux");
    let file = |path: &Path| format!("file:{}", path.display());
    let status = Command::new("timeout")
        .args([PATIENCE_S, "qemu-system-x86_64"])
        .args(["-accel", "tcg,thread=multi", "-cpu", "max", "-smp", "2", "-m", "768"])
        .args(["-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"])
        .args(["-serial", &file(&console), "-serial", "stdio", "-serial", &file(&results)])
        .arg("-kernel")
        .arg(cache.join("vmlinux"))
        .arg("-initrd")
        .arg(image)
        .args([
            "-append",
            "console=ttyS0 panic=-1 quiet mitigations=off nokaslr random.trust_cpu=on tsc=reliable",
        ])
        .stdin(Stdio::null())
        .status()
        .map_err(|e| format!("qemu-system-x86_64 does not start: {e}"))?;
    let said = fs::read(&console).unwrap_or_default();
    let said = String::from_utf8_lossy(&said);
    if !said.contains(ENDED) {
        return Err(format!("the guest has not come to its end ({status}): {said}"));
    }
    let unpacked = Command::new("tar").arg("-xzf").arg(&results).arg("-C").arg(out).status();
    if unpacked.is_ok_and(|s| s.success()) { Ok(()) } else { Err("the guest has left nothing".into()) }
}
