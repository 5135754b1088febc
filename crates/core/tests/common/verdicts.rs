//! Verdicts on right inputs and on inputs with a fault: which are alarms, and which faults are called right.

/// What was counted.
#[derive(Default)]
pub struct Verdicts {
    n_right: usize,
    n_faults: usize,
    n_ok: usize,
    alarms: Vec<String>,
    silent: Vec<String>,
}

impl Verdicts {
    /// Adds the answer to a right input.
    pub fn right(&mut self, what: String, is_ok: bool) {
        self.n_right += 1;
        println!("{what}");
        if !is_ok {
            self.alarms.push(what);
        }
    }

    /// Adds a fault that has no answer.
    pub fn refused(&mut self, what: String) {
        self.n_faults += 1;
        println!("{what}");
    }

    /// Adds the answer to a fault, which is off by so many standard deviations.
    pub fn fault(&mut self, what: &str, is_ok: bool, off: f64, described: &str) {
        self.n_faults += 1;
        let line = format!("{what}: {} {off:.1} σ {described}", if is_ok { "ok" } else { "NOT" });
        println!("{line}");
        self.n_ok += usize::from(is_ok);
        if is_ok && 3.0 < off {
            println!("WRONG {line}");
            self.silent.push(line);
        }
    }

    /// Asserts that at most so many answers are wrong by more than three standard deviations and called right, and at most one right input in twenty
    /// is not.
    pub fn check(&self, most_silent: usize) {
        let Verdicts { n_right, n_faults, n_ok, alarms, silent } = self;
        println!(
            "of {n_faults} faults {n_ok} are ok, {} of them wrong; of {n_right} right inputs {} are not",
            silent.len(),
            alarms.len()
        );
        assert!(silent.len() <= most_silent && 20 * alarms.len() <= *n_right, "{alarms:#?} {silent:#?}");
    }
}
