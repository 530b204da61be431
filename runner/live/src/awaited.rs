//! What a job waits for from the machine, and what the operator has to do about it.

/// How a plug-in begins the name of a state in which it waits.
const WAITING: &str = "waiting for ";

/// What is awaited in a state of this name, and what is to be done, in a sentence; none if
/// nothing is. `state`: as the plug-in says it.
///
/// ```
/// use softplug_live::awaited::awaited;
///
/// let text = awaited("waiting for DC1").expect("something is awaited");
/// assert_eq!(text, "waits for the machine to ask for the program (DC1): press READ at the control");
/// assert_eq!(awaited("sending"), None);
/// ```
pub fn awaited(state: &str) -> Option<String> {
    let what = state.strip_prefix(WAITING)?;
    Some(match what {
        "DC1" => "waits for the machine to ask for the program (DC1): press READ at the control".into(),
        "XON" => "waits for the machine to say go (XON): start reading at the machine".into(),
        "DC3" => {
            "all is sent; waits for the machine to end its reading (DC3): see whether the control has \
             the program"
                .into()
        }
        "DLE" => {
            "waits for the machine to answer (DLE): see that it is on, connected and ready to take data"
                .into()
        }
        "acknowledgement" => {
            "waits for the machine to acknowledge what it was sent: see that it is on and takes data"
                .into()
        }
        "the control" => {
            "waits for the control to ask for the program: start reading there".into()
        }
        // What we ourselves make room for.
        "a buffer" => "waits for room for what the machine sends".into(),
        "the program" => "waits for the program's data".into(),
        "silence" => "waits until the line is silent".into(),
        other => {
            let other = other.escape_debug();
            format!("waits for {other} from the machine: see that it is on and ready to take data")
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_that_waits_is_told_with_what_to_do() {
        for what in ["DC1", "XON", "DLE", "acknowledgement", "a key \u{1b}[2J"] {
            let text = awaited(&format!("waiting for {what}")).unwrap();
            assert!(text.starts_with("waits for ") && text.contains(": "), "{text}");
            assert!(!text.contains('\u{1b}'), "{text}");
        }
        for state in ["", "idle", "sending", "held", "paused", "waiting"] {
            assert_eq!(awaited(state), None, "{state}");
        }
    }
}
