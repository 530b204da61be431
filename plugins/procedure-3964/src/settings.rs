//! The settings of the procedure, declared once; a plug-in gives the defaults.

use softplug_plugin::choice;

choice! {
    /// Who withdraws when both sides begin at the same time.
    pub enum Priority {
        /// We withdraw.
        Low = "low",
        /// We insist.
        High = "high",
        /// Nobody: the partner's STX is a wrong character.
        None = "none",
    }
}

choice! {
    /// What is spoken on top of the procedure.
    pub enum Layer {
        /// Nothing: blocks are data.
        None = "none",
        /// RK512: blocks are telegrams.
        Rk512 = "rk512",
    }
}

/// Declares a struct of all settings, with the defaults of one plug-in.
#[macro_export]
macro_rules! procedure_settings {
    (
        $(#[$attr:meta])*
        $vis:vis struct $name:ident {
            priority: $priority:literal, qvz: $qvz:literal, bwz: $bwz:literal,
            buffer_wait: $buffer_wait:literal, setup_attempts: $setup:literal,
            transmission_attempts: $transmission:literal, block_size: $block:literal,
            nak_at_start: $at_start:literal, nak_on_garbage: $garbage:literal $(,)?
        }
    ) => {
        $crate::softplug_plugin::settings! {
            $(#[$attr])*
            $vis struct $name {
                bcc: bool = true, "Block check: 3964R; off: 3964.";
                handshake: bool = true, "DLE answers STX; off: all in one go.";
                doubling: bool = true, "DLE in data is doubled.";
                priority: $crate::Priority = $priority, "In a conflict; none: STX is a wrong character.";
                qvz: i64 = $qvz in 0..=60000 "ms", "Acknowledgement delay; 0: 2000 with BCC, 550 without.";
                zvz: i64 = 220 in 1..=60000 "ms", "Character delay.";
                bwz: i64 = $bwz in 0..=60000 "ms", "Block wait; 0: no repetition.";
                buffer_wait: i64 = $buffer_wait in 0..=60000 "ms", "Wait for a free buffer.";
                setup_attempts: i64 = $setup in 1..=255 "", "STX tries.";
                transmission_attempts: i64 = $transmission in 1..=255 "", "Block tries.";
                block_size: i64 = $block in 1..=1024 "bytes", "Largest block.";
                split: bool = false, "A longer job is several blocks.";
                nak_at_start: bool = $at_start, "NAK at the opening.";
                nak_on_garbage: bool = $garbage, "NAK after idle garbage.";
                layer: $crate::Layer = "none", "What blocks carry: data or telegrams.";
                reaction_timeout: i64 = 20000 in 0..=600000 "ms", "RK512; 0: by baud.";
            }
        }
    };
}

procedure_settings! {
    /// The settings, with the defaults of 3964R.
    pub struct Options {
        priority: "low",
        qvz: 0,
        bwz: 4000,
        buffer_wait: 400,
        setup_attempts: 6,
        transmission_attempts: 6,
        block_size: 1024,
        nak_at_start: true,
        nak_on_garbage: true,
    }
}

/// The part of the manifest that is the same for all plug-ins: jobs, requests,
/// status codes, needs and state.
#[macro_export]
macro_rules! procedure_manifest {
    () => {
        concat!(
            r#""jobs":[{"name":"send","text":"Sends a block."},"#,
            r#"{"name":"write","text":"RK512 SEND","fields":["#,
            $crate::place_fields!("DB or DX"),
            "]},",
            r#"{"name":"read","text":"RK512 FETCH","fields":["#,
            $crate::place_fields!("DB, DX, I, Q, M, T or C"),
            "]}],",
            r#""requests":[{"name":"write","text":"SEND came","fields":["#,
            $crate::place_fields!(),
            ",",
            r#"{"name":"data","type":"bytes","text":""}]},"#,
            r#"{"name":"read","text":"FETCH came","fields":["#,
            $crate::place_fields!(),
            "]}],",
            r#""status":["#,
            r#"{"code":10,"name":"0A","text":"no access"},"#,
            r#"{"code":12,"name":"0C","text":"no such area"},"#,
            r#"{"code":16,"name":"10","text":"header not known"},"#,
            r#"{"code":18,"name":"12","text":"no such area"},"#,
            r#"{"code":20,"name":"14","text":"not found"},"#,
            r#"{"code":22,"name":"16","text":"command not known"},"#,
            r#"{"code":42,"name":"2A","text":"partner in stop"},"#,
            r#"{"code":50,"name":"32","text":"locked by its flag"},"#,
            r#"{"code":52,"name":"34","text":"length"},"#,
            r#"{"code":54,"name":"36","text":"sequence"},"#,
            r#"{"code":1294,"name":"(05)0E","text":"bad length"},"#,
            r#"{"code":1303,"name":"(05)17","text":"too long"},"#,
            r#"{"code":1793,"name":"(07)01","text":"repetition"},"#,
            r#"{"code":1794,"name":"(07)02","text":"STX: refused"},"#,
            r#"{"code":1795,"name":"(07)03","text":"STX: QVZ"},"#,
            r#"{"code":1796,"name":"(07)04","text":"disturbed"},"#,
            r#"{"code":1797,"name":"(07)05","text":"NAK in block"},"#,
            r#"{"code":1798,"name":"(07)06","text":"end: refused"},"#,
            r#"{"code":1799,"name":"(07)07","text":"end: QVZ"},"#,
            r#"{"code":1802,"name":"(07)0A","text":"attempts used up"},"#,
            r#"{"code":1803,"name":"(07)0B","text":"both high"},"#,
            r#"{"code":1804,"name":"(07)0C","text":"both low"},"#,
            r#"{"code":2049,"name":"(08)01","text":"NAK sent"},"#,
            r#"{"code":2050,"name":"(08)02","text":"garbage"},"#,
            r#"{"code":2053,"name":"(08)05","text":"lone DLE"},"#,
            r#"{"code":2054,"name":"(08)06","text":"ZVZ"},"#,
            r#"{"code":2056,"name":"(08)08","text":"BCC"},"#,
            r#"{"code":2058,"name":"(08)0A","text":"no buffer"},"#,
            r#"{"code":2060,"name":"(08)0C","text":"damaged character"},"#,
            r#"{"code":2061,"name":"(08)0D","text":"BREAK"}],"#,
            r#""needs":{"line_errors":"used"},"#,
            r#""state":{"saves":2,"accepts":[2]}"#,
        )
    };
}

/// Where data stands in a partner's memory, as fields of jobs, explained, and of
/// requests.
#[doc(hidden)]
#[macro_export]
macro_rules! place_fields {
    () => {
        $crate::place_fields!("as in jobs", "", "", "", "", "")
    };
    ($areas:literal) => {
        $crate::place_fields!(
            $areas,
            "number of the DB or DX",
            "first word; of I, Q, M: byte",
            "words; of I, Q, M: bytes",
            "coordination flag",
            "1 to 4"
        )
    };
    ($area:literal, $block:literal, $offset:literal, $count:literal, $flag:literal, $cpu:literal) => {
        concat!(
            r#"{"name":"area","type":"text","required":true,"text":""#,
            $area,
            r#""},{"name":"block","type":"int","text":""#,
            $block,
            r#""},{"name":"offset","type":"int","text":""#,
            $offset,
            r#""},{"name":"count","type":"int","text":""#,
            $count,
            r#""},{"name":"flag_byte","type":"int","text":""#,
            $flag,
            r#""},{"name":"flag_bit","type":"int","text":""#,
            $flag,
            r#""},{"name":"cpu","type":"int","text":""#,
            $cpu,
            r#""}"#,
        )
    };
}
