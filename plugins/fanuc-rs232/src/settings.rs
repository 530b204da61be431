//! The settings, and the manifest with them in it.

use softplug_plugin::{Bytes, Text, choice, settings};

choice! {
    /// Which interface of the control we talk to.
    pub enum Mode { Reader = "reader", RemoteA = "remote-a", RemoteB = "remote-b" }
}

choice! {
    /// The code that we send.
    pub enum SendCode { Iso = "iso", Eia = "eia" }
}

choice! {
    /// The code of what comes.
    pub enum ReceiveCode { Auto = "auto", Iso = "iso", Eia = "eia" }
}

choice! {
    /// Who makes ISO's even parity.
    pub enum ParityMode { Uart = "uart", Software = "software", None = "none" }
}

choice! {
    /// The end of a block as it is sent in ISO.
    pub enum Eob { Lf = "lf", CrLf = "crlf", LfCrCr = "lfcrcr", LfCr = "lfcr", Cr = "cr" }
}

choice! {
    /// The end of a line in what is delivered.
    pub enum LineEnd { Lf = "lf", CrLf = "crlf" }
}

choice! {
    /// What to do with a character that the code does not have.
    pub enum Unsupported { Refuse = "refuse", Space = "space", Drop = "drop" }
}

choice! {
    /// What to do with text behind the closing `%`.
    pub enum AfterEnd { Refuse = "refuse", Drop = "drop" }
}

choice! {
    /// What to do with block numbers.
    pub enum BlockNumbers { Keep = "keep", Strip = "strip", Renumber = "renumber" }
}

choice! {
    /// How we hold the control's output.
    pub enum OutputFlow { Dc3 = "dc3", Rts = "rts", None = "none" }
}

choice! {
    /// What lets the control's output go on.
    pub enum ResumeCode { Dc1 = "dc1", Dc2 = "dc2" }
}

choice! {
    /// What becomes of several programs in one capture.
    pub enum Programs { Keep = "keep", Split = "split" }
}

choice! {
    /// What a damaged character does to a capture.
    pub enum OnLineError { Fail = "fail", Keep = "keep" }
}

choice! {
    /// The end code of a packet.
    pub enum PacketEnd { Cr = "cr", Etx = "etx" }
}

settings! {
    /// The settings of FANUC RS-232.
    pub struct Settings {
        mode: Mode = "reader", "Interface.";
        code: SendCode = "iso", "Code sent.";
        receive_code: ReceiveCode = "auto", "Code received.";
        parity: ParityMode = "uart", "Who makes ISO's parity.";
        plain_codes: bool = false, "DC codes without parity.";
        eob: Eob = "lf", "EOB sent in ISO.";
        line_end: LineEnd = "lf", "Line ends delivered.";
        leader: i64 = 0 in 0..=2000 "characters", "NULs before.";
        trailer: i64 = 0 in 0..=2000 "characters", "NULs behind.";
        tv_pad: bool = false, "Pad odd blocks.";
        tv_check: bool = false, "Odd blocks fail.";
        tv_cr: bool = true, "CRs count for TV.";
        tv_comments: bool = true, "Comments count for TV.";
        upper: bool = true, "Capitals.";
        unsupported: Unsupported = "refuse", "What the code lacks.";
        replace: Bytes<64> = "", "Pairs: character, sent.";
        ascii: bool = false, "ISO: all of ASCII.";
        eia_codes: Bytes<32> = "", "Pairs: character, EIA code.";
        percent: bool = true, "Add a % that lacks.";
        after_end: AfterEnd = "refuse", "Text behind the last %.";
        block_numbers: BlockNumbers = "keep", "N numbers.";
        number_step: i64 = 10 in 1..=1000 "", "Number step.";
        dc1_timeout: i64 = 0 in 0..=86400000 "ms", "Wait for DC1; 0: any.";
        held_timeout: i64 = 0 in 0..=86400000 "ms", "Longest DC3; 0: any.";
        end_wait: i64 = 0 in 0..=600000 "ms", "Wait for final DC3.";
        watch_dsr: bool = false, "DSR off ends all.";
        output_flow: OutputFlow = "dc3", "Holds the control.";
        resume_code: ResumeCode = "dc1", "Resumes it.";
        need_dc2: bool = true, "Capture after DC2 only.";
        answer_dc2: bool = false, "Answer DC2 with DC1.";
        end_quiet: i64 = 500 in 1..=600000 "ms", "Silence that ends one.";
        after_dc4: i64 = 200 in 0..=60000 "ms", "Wait for SYN or NAK.";
        quiet_time: i64 = 10000 in 0..=600000 "ms", "Silence that fails; 0: none.";
        programs: Programs = "keep", "Several programs.";
        on_line_error: OnLineError = "fail", "Damaged characters.";
        request_program: i64 = 9999 in 0..=99999999 "", "Number of a request.";
        request_pattern: Text<32> = "(SEND *)", "Its comment; * the name.";
        poll_time: i64 = 5000 in 100..=60000 "ms", "Longest silence (Tp).";
        packet_size: i64 = 1024 in 16..=1024 "bytes", "Data in a DAT.";
        packet_end: PacketEnd = "cr", "End of a packet.";
    }
}

pub(crate) const MANIFEST: &str = softplug_plugin::manifest! {
    head: concat!(
        r#""abi":"1.1","name":"fanuc-rs232","version":""#, env!("CARGO_PKG_VERSION"),
        r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
        r#"","protocol":"FANUC RS-232","description":"Reader/punch, remote buffer.""#,
    ),
    settings: Settings,
    tail: concat!(
        r#""presets":["#,
        r#"{"name":"series-0","text":"As series 0.","values":{"plain_codes":true,"eob":"lfcrcr"}},"#,
        r#"{"name":"15-remote-a","text":"Buffer A.","values":{"mode":"remote-a"}},"#,
        r#"{"name":"eia","text":"EIA, 8N2.","values":{"code":"eia","receive_code":"eia","parity":"none"}},"#,
        r#"{"name":"software-parity","text":"8-bit line.","values":{"parity":"software"}}],"#,
        r#""jobs":[{"name":"send","text":"Sends a program.","fields":["#,
        r#"{"name":"from_block","type":"int","text":"First block, from 1."},"#,
        r#"{"name":"from_sequence","type":"int","text":"Its N number."},"#,
        r#"{"name":"preamble","type":"text","text":"Sent before it."},"#,
        r#"{"name":"from_line","type":"int","text":"Or first line of the file, from 1."}]}],"#,
        r#""requests":[{"name":"program","text":"The panel asks.","fields":["#,
        r#"{"name":"name","type":"text","text":"Its name."},"#,
        r#"{"name":"number","type":"int","text":"Its number."}]}],"#,
        r#""profiles":[{"name":"fanuc-rs232","features":["eia","parity","tv","restart","request","remote"]}],"#,
        r#""status":["#,
        r#"{"code":1,"name":"bad-job 1","text":"a field is out of range"},"#,
        r#"{"code":2,"name":"bad-job 2","text":"the preamble cannot be sent"},"#,
        r#"{"code":3,"name":"bad-job 3","text":"text before the first %"},"#,
        r#"{"code":4,"name":"bad-job 4","text":"text behind the closing %, which ends the tape; after_end=drop leaves it out"}],"#,
        r#""needs":{"line_errors":"used","modem_lines":"used","software_parity":true,"check_pass":true},"#,
        r#""state":{"saves":1,"accepts":[1]},"line":"4800 7E2","line_when":["#,
        r#"{"when":{"parity":"software"},"line":"4800 8N2"},"#,
        r#"{"when":{"parity":"none"},"line":"4800 8N2"},"#,
        r#"{"when":{"code":"eia"},"line":"4800 8N2"}]"#,
    ),
};

impl Settings {
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        let is_paired = |pairs: &[u8]| pairs.len().is_multiple_of(2);
        if !is_paired(self.replace.as_slice()) || !is_paired(self.eia_codes.as_slice()) {
            return Err("replace and eia_codes need pairs");
        }
        if self.mode == Mode::RemoteA && self.code == SendCode::Eia {
            return Err("remote-a needs code iso");
        }
        if self.mode == Mode::RemoteA && self.packet_end == PacketEnd::Cr && self.eob != Eob::Lf {
            return Err("packets end with CR; set eob to lf");
        }
        let pattern = self.request_pattern.as_bytes();
        if !pattern.is_empty() && pattern.split(|byte| *byte == b'*').count() != 2 {
            return Err("request_pattern needs one *");
        }
        Ok(())
    }
}
