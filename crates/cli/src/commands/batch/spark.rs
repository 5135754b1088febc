//! `--engine spark`: the same job on a cluster. Spark speaks Python, and the Python package knows how to ask it: this runs that, and says where it
//! is to be had when it is not there.

use crate::output::{Outcome, print_answer};
use anyhow::{Context, Result, bail};
use resight_fleet::answer::{BatchObject, ClusterAnswer};
use resight_fleet::job::BatchRequest;
use std::ffi::OsString;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Names the interpreter of the Python package; the `resight` that it installs sets it itself.
const PYTHON: &str = "RESIGHT_PYTHON";

pub(super) fn run(request: &BatchRequest, master: Option<&str>, json: bool) -> Result<Outcome> {
    let python = interpreter()?;
    if 0 < request.threads {
        bail!("--threads is for this machine; a cluster has its own setting, spark.executor.cores");
    }
    let begun = Instant::now();
    let job = serde_json::json!({
        "inputs": request.inputs, "cameras": request.cameras, "target": request.target, "output": request.output,
        "drift": request.drift, "sigma_px": request.sigma_px, "period_s": request.period_s, "master": master,
    });
    // Words and progress go where those of this program go; the answer comes back here.
    let ended = Command::new(&python)
        .args(["-m", "resight._spark_job", &job.to_string()])
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("{} cannot be started", python.display()))?;
    if !ended.status.success() {
        bail!("the job on the cluster ended without an answer ({}); its words are above", ended.status);
    }
    let text = String::from_utf8_lossy(&ended.stdout);
    let line = text.lines().last().unwrap_or_default();
    let answer: ClusterAnswer = serde_json::from_str(line).with_context(|| {
        format!("{} gave no answer; is its package `resight` of this version?", python.display())
    })?;
    let answer = BatchObject::of_cluster(answer, &request.output, begun.elapsed().as_secs_f64());
    print_answer(json, &answer, &answer.in_words(), answer.status())?;
    Ok(if answer.is_damaged() { Outcome::Damaged } else { Outcome::of([answer.status()]) })
}

fn interpreter() -> Result<OsString> {
    match std::env::var_os(PYTHON).filter(|python| !python.is_empty()) {
        Some(python) => Ok(python),
        None => bail!(
            "--engine spark needs the Python package: pip install resight[spark], and the `resight` that it installs; or name its interpreter in \
             {PYTHON}"
        ),
    }
}
