//! Small plug-ins, made when they are needed.

/// A plug-in of this name and version that sends back what it receives. `salt` makes
/// modules of the same name and version differ.
pub(crate) fn echo(name: &str, version: &str, salt: &str) -> Vec<u8> {
    let text = include_str!("../../../../sdk/host/tests/guests/echo.wat")
        .replace(r#"\"name\": \"echo\""#, &format!(r#"\"name\": \"{name}\""#))
        .replace(r#"\"version\": \"1.0.0\""#, &format!(r#"\"version\": \"{version}\""#))
        .replace("Sends back", &format!("{salt}Sends back"));
    wat::parse_str(text).unwrap()
}
