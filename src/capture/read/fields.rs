//! Typed access to the fields of a JSON object; every error names the field by its path.

use crate::error::{Error, Result};
use glam::DVec3;
use serde_json::{Map, Value};

/// The text of a file without a UTF-8 byte order mark.
pub fn without_bom(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// A JSON object and its path, e.g. `transforms.json: frames[3].`.
#[derive(Debug, Clone)]
pub struct Fields<'a> {
    place: String,
    map: &'a Map<String, Value>,
}

impl<'a> Fields<'a> {
    /// The object at `place`, a prefix that a field's name completes.
    ///
    /// # Errors
    /// The value is not an object.
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

    /// A finite number.
    ///
    /// # Errors
    /// The field is something else.
    pub fn number(&self, name: &str) -> Result<Option<f64>> {
        self.get(name)
            .map(|value| match value.as_f64() {
                Some(x) if x.is_finite() => Ok(x),
                _ => Err(wrong(&self.place(name), "is not a finite number")),
            })
            .transpose()
    }

    /// A whole number from 1 to 2³²−1, also written as 540.0.
    ///
    /// # Errors
    /// The field is something else.
    pub fn count(&self, name: &str) -> Result<Option<u32>> {
        let number = self.number(name)?;
        number
            .map(|x| {
                if x >= 1.0 && x <= f64::from(u32::MAX) && x.fract() == 0.0 {
                    Ok(x as u32)
                } else {
                    Err(wrong(&self.place(name), "is not a positive whole number"))
                }
            })
            .transpose()
    }

    /// A string.
    ///
    /// # Errors
    /// The field is something else.
    pub fn text(&self, name: &str) -> Result<Option<&'a str>> {
        self.get(name)
            .map(|value| {
                value
                    .as_str()
                    .ok_or_else(|| wrong(&self.place(name), "is not a string"))
            })
            .transpose()
    }

    /// Three finite numbers.
    ///
    /// # Errors
    /// The field is something else.
    pub fn vector(&self, name: &str) -> Result<Option<DVec3>> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        match numbers(value).as_deref() {
            Some(&[x, y, z]) if x.is_finite() && y.is_finite() && z.is_finite() => {
                Ok(Some(DVec3::new(x, y, z)))
            }
            _ => Err(wrong(&self.place(name), "is not three finite numbers")),
        }
    }

    /// Rows of numbers.
    ///
    /// # Errors
    /// The field is something else.
    pub fn matrix(&self, name: &str) -> Result<Option<Vec<Vec<f64>>>> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        let rows = (value.as_array()).and_then(|array| array.iter().map(numbers).collect());
        rows.map(Some)
            .ok_or_else(|| wrong(&self.place(name), "is not a matrix of numbers"))
    }
}

/// The numbers of a list; `None` if it is something else.
pub fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn wrong(place: &str, problem: &str) -> Error {
    Error::new(place, problem, "correct the field")
}
