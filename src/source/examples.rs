//! The models that come with the program, embedded so that `bondspice examples` can show and copy them.

macro_rules! examples {
    ($($path:literal)*) => {
        &[$(($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/models/", $path)))),*]
    };
}

/// Each model by its path in the folder of models, and its text.
pub const EXAMPLES: &[(&str, &str)] = examples! {
    "rlc.bg"
    "msd.bg"
    "rlc_bridge.bg"
    "gear_dep.bg"
    "duffing.bg"
    "two_tank.bg"
    "dc_motor_load.bg"
    "buck.bg"
    "buck_pwm.bg"
    "end_stop.bg"
    "stick_slip.bg"
    "sampled_controller.bg"
    "coupled_coils.bg"
    "plate_transducer.bg"
    "solenoid.bg"
    "eha_one_line.bg"
    "eha_components.bg"
    "eha_two_line.bg"
    "eha_lever.bg"
    "eha_fig13.bg"
    "drive_train.bg"
    "step_down.bg"
    "reversing_drive.bg"
    "ten_motors.bg"
    "half_wing.bg"
    "servo_axis.bg"
    "hydraulic_line.bg"
    "hydraulic_press.bg"
    "lifting_jack.bg"
    "rough_belt.bg"
    "mass_between_stops.bg"
    "textbook/A1.bg"
    "textbook/A2.bg"
    "textbook/A3.bg"
    "textbook/A4.bg"
    "textbook/A5.bg"
    "textbook/A6.bg"
    "textbook/A7.bg"
    "textbook/A8.bg"
    "textbook/C1.bg"
    "textbook/D1.bg"
    "textbook/D3.bg"
    "textbook/E1.bg"
    "textbook/E2.bg"
    "textbook/E4.bg"
    "textbook/F1.bg"
    "textbook/F2.bg"
    "textbook/G1.bg"
    "textbook/G2.bg"
};

/// The row of a name, with or without its ending.
pub fn find(name: &str) -> Option<(&'static str, &'static str)> {
    let known = |path: &str| path == name || path.strip_suffix(".bg") == Some(name);
    EXAMPLES.iter().find(|(path, _)| known(path)).copied()
}

/// What a model is, in a sentence: the first of the comment that it begins with.
pub fn title(path: &str, text: &str) -> String {
    let comment: Vec<&str> = text
        .lines()
        .map_while(|line| line.trim_start().strip_prefix('#'))
        .map(str::trim)
        .take_while(|line| !line.is_empty())
        .collect();
    let whole = comment.join(" ");
    let name = path.rsplit('/').next().unwrap_or(path);
    let said =
        whole.strip_prefix(name).map_or(whole.as_str(), |rest| rest.trim_start_matches([':', ' ']));
    // A full stop ends a sentence but after an abbreviation and before a number.
    let ends = said.match_indices(". ").map(|(at, _)| at).find(|at| {
        let word = said[..*at].rsplit([' ', '(']).next().unwrap_or("");
        let number = said[at + 2..].starts_with(|c: char| c.is_ascii_digit());
        !number && !["al", "ch", "Fig", "Figs", "No", "cf"].contains(&word)
    });
    let sentence = ends.map_or(said, |at| &said[..at]);
    // Where it comes from is read with the model itself.
    let sentence = sentence.split(" (").next().unwrap_or(sentence);
    sentence.trim_end_matches(['.', ':']).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_says_what_it_is() {
        for (path, text) in EXAMPLES {
            let title = title(path, text);
            assert!(title.chars().count() > 15, "{path}: `{title}`");
            assert!(!title.contains(path) && !title.ends_with('.'), "{path}: `{title}`");
        }
        assert_eq!(
            title("a/b.bg", "# b.bg: a brace of Smith et al. in R, C. q = 2.\n1:x"),
            "a brace of Smith et al. in R, C"
        );
        assert_eq!(title("b.bg", "1:x\n# late"), "");
    }

    #[test]
    fn names_may_lack_their_ending() {
        assert_eq!(find("textbook/A1").unwrap().0, "textbook/A1.bg");
        assert_eq!(find("rlc.bg").unwrap().0, "rlc.bg");
        assert!(find("A1").is_none());
    }
}
