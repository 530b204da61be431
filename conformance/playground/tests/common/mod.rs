//! A module that never ends.

/// The smallest plug-in, in which every step is an endless loop.
pub(crate) fn endless() -> Vec<u8> {
    let echo = include_str!("../../../../fixtures/abi/echo.wat");
    let head = "(param $kind i32) (param $len i32) (param $now i64) (result i32)";
    let endless = echo.replacen(head, &format!("{head} (loop $on (br $on))"), 1);
    assert_ne!(endless, echo, "the fixture has another head");
    wat::parse_str(endless).unwrap()
}
