//! Fields of jobs and requests: text in a trace, value records for a plug-in.

use softplug_abi::limits::VALUE_BYTES;
use softplug_abi::manifest::{Field, Kind, OwnedValue, Setting, ValueType};
use softplug_abi::{Value, ValueWriter, Values};
use softplug_trace::Assignment;

/// The fields as value records.
pub(crate) fn records(kind: &Kind, fields: &[Assignment]) -> Result<Vec<u8>, String> {
    let mut values = Vec::new();
    for field in fields {
        let place = kind.fields.iter().position(|known| known.name == field.name);
        let place =
            place.ok_or_else(|| format!("\"{}\" has no field \"{}\"", kind.name, field.name))?;
        values.push((place, value(&kind.fields[place], &field.value)?));
    }
    values.sort_by_key(|(place, _)| *place);
    let mut buffer = vec![0; values.len() * (6 + VALUE_BYTES)];
    let mut writer = ValueWriter::new(&mut buffer);
    for (place, value) in &values {
        let name = &kind.fields[*place].name;
        writer
            .push(*place as u16, value.as_value())
            .map_err(|_| format!("field \"{name}\" is longer than {VALUE_BYTES} bytes"))?;
    }
    Ok(writer.written().to_vec())
}

/// The other way round, as far as the records can be read.
pub(crate) fn assignments(kind: &Kind, records: &[u8]) -> Vec<Assignment> {
    let known = Values::new(records).map_while(Result::ok);
    let named = known.filter_map(|(place, value)| {
        let name = kind.fields.get(usize::from(place))?.name.clone();
        Some(Assignment { name, value: text(value) })
    });
    named.collect()
}

/// A field of type choice carries a number; all else is written as in settings.
fn value(field: &Field, text: &str) -> Result<OwnedValue, String> {
    if field.kind == ValueType::Choice {
        let number =
            text.parse().map_err(|_| format!("field \"{}\" needs a number", field.name))?;
        return Ok(OwnedValue::Choice(number));
    }
    let like_a_setting = Setting {
        name: field.name.clone(),
        kind: field.kind,
        default: serde_json::Value::Null,
        min: None,
        max: None,
        unit: String::new(),
        choices: Vec::new(),
        text: String::new(),
    };
    like_a_setting.value_from_text(text).map_err(|error| error.to_string())
}

fn text(value: Value<'_>) -> String {
    match value {
        Value::Bool(value) => if value { "on" } else { "off" }.to_owned(),
        Value::Int(value) => value.to_string(),
        Value::Text(text) => text.to_owned(),
        Value::Bytes(bytes) => {
            bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
        }
        Value::Choice(value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kind() -> Kind {
        let field = |name: &str, kind| Field {
            name: name.to_owned(),
            kind,
            required: false,
            text: String::new(),
        };
        Kind {
            name: "program".to_owned(),
            text: String::new(),
            fields: vec![
                field("number", ValueType::Int),
                field("title", ValueType::Text),
                field("head", ValueType::Bytes),
                field("last", ValueType::Bool),
                field("side", ValueType::Choice),
            ],
        }
    }

    fn assigned(list: &[(&str, &str)]) -> Vec<Assignment> {
        let one = |(name, value): &(&str, &str)| Assignment {
            name: (*name).to_owned(),
            value: (*value).to_owned(),
        };
        list.iter().map(one).collect()
    }

    #[test]
    fn every_type_comes_back_in_the_manifests_order() {
        let given = assigned(&[
            ("side", "2"),
            ("last", "yes"),
            ("head", "0aFF"),
            ("title", "a b"),
            ("number", "-7"),
        ]);
        let expected = assigned(&[
            ("number", "-7"),
            ("title", "a b"),
            ("head", "0A FF"),
            ("last", "on"),
            ("side", "2"),
        ]);
        assert_eq!(assignments(&kind(), &records(&kind(), &given).unwrap()), expected);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let message = |name, value| records(&kind(), &assigned(&[(name, value)])).unwrap_err();
        assert_eq!(message("colour", "red"), "\"program\" has no field \"colour\"");
        assert_eq!(message("side", "left"), "field \"side\" needs a number");
        assert!(message("number", "many").contains("\"many\" is not a whole number"));
        assert!(message("title", &"x".repeat(401)).contains("401"));
    }
}
