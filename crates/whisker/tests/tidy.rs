//! The house rules that a machine can check.

#[test]
fn modules_use_only_those_above_them() {
    crate::tidy_rules::modules_use_only_those_above_them(20);
}

#[test]
fn submodules_use_only_those_above_them() {
    crate::tidy_rules::submodules_use_only_those_above_them(2);
}

#[test]
fn nothing_outside_is_touched() {
    crate::tidy_rules::nothing_outside_is_touched();
}

#[test]
fn nothing_panics_on_purpose() {
    crate::tidy_rules::nothing_panics_on_purpose();
}

#[test]
fn every_cited_equation_exists() {
    crate::tidy_rules::every_cited_equation_exists(20);
}
