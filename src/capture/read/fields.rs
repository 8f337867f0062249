//! Typed access to the fields of a JSON object. A field of another type is an error that names it by its path.

use crate::error::{Error, Result};
use glam::DVec3;
use serde_json::{Map, Value};

/// The text of a file without a UTF-8 byte order mark.
pub fn without_bom(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// A JSON object and its path, e.g. `transforms.json: frames[3].`.
pub struct Fields<'a> {
    place: String,
    map: &'a Map<String, Value>,
}

impl<'a> Fields<'a> {
    /// The object at `place`, a prefix that a field's name completes.
    pub fn new(place: String, value: &'a Value) -> Result<Self> {
        match value {
            Value::Object(map) => Ok(Self { place, map }),
            _ => Err(wrong(&place, "is not a JSON object")),
        }
    }

    /// The field's full path, for messages.
    pub fn place(&self, name: &str) -> String {
        format!("{}{name}", self.place)
    }

    /// The field, unless absent or null.
    pub fn get(&self, name: &str) -> Option<&'a Value> {
        self.map.get(name).filter(|value| !value.is_null())
    }

    /// These fields where they have one of this name, else `shared`.
    pub fn or<'b>(&'b self, shared: &'b Self, name: &str) -> &'b Self {
        match self.get(name) {
            Some(_) => self,
            None => shared,
        }
    }

    /// The field as `parse` reads it; `wanted` says what that is.
    fn parsed<T>(
        &self,
        name: &str,
        wanted: &str,
        parse: impl FnOnce(&'a Value) -> Option<T>,
    ) -> Result<Option<T>> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        let parsed = parse(value).map(Some);
        parsed.ok_or_else(|| wrong(&self.place(name), &format!("is not {wanted}")))
    }

    pub fn number(&self, name: &str) -> Result<Option<f64>> {
        let finite = |value: &Value| value.as_f64().filter(|x| x.is_finite());
        self.parsed(name, "a finite number", finite)
    }

    /// A whole number from 1 to 2³²−1, also written as 540.0.
    pub fn count(&self, name: &str) -> Result<Option<u32>> {
        let number = self.number(name)?;
        self.parsed(name, "a positive whole number", |_| {
            let whole = |x: &f64| (1.0..=f64::from(u32::MAX)).contains(x) && x.fract() == 0.0;
            number.filter(whole).map(|x| x as u32)
        })
    }

    pub fn text(&self, name: &str) -> Result<Option<&'a str>> {
        self.parsed(name, "a string", Value::as_str)
    }

    pub fn vector(&self, name: &str) -> Result<Option<DVec3>> {
        self.parsed(name, "three finite numbers", |value| {
            let numbers = <[f64; 3]>::try_from(numbers(value)?).ok()?;
            Some(DVec3::from(numbers)).filter(|v| v.is_finite())
        })
    }

    /// The entries of `frames`.
    pub fn frames(&self) -> Result<&'a [Value]> {
        let list = self.get("frames").and_then(Value::as_array);
        let wrong = || {
            Error::new(
                self.place("frames"),
                "is not a list of frames",
                "add the photographs",
            )
        };
        list.map(Vec::as_slice).ok_or_else(wrong)
    }

    pub fn matrix(&self, name: &str) -> Result<Option<Vec<Vec<f64>>>> {
        self.parsed(name, "a matrix of numbers", |value| {
            value.as_array()?.iter().map(numbers).collect()
        })
    }
}

/// The numbers of a list; `None` if it is something else.
pub fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn wrong(place: &str, problem: &str) -> Error {
    Error::new(place, problem, "correct the field")
}
