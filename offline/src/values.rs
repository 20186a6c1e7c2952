//! What options are spelt like: lists, fractions of polynomials, ranges.

use teleclay_control::{RationalFunction, paper};
use teleclay_proto::http::theory::TransferFunction;

/// One number.
pub(crate) fn number(text: &str) -> Result<f64, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err("a number is missing".to_owned());
    }
    let number: f64 = text
        .parse()
        .map_err(|_| format!("`{text}` is not a number"))?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(format!("`{text}` is not a finite number"))
    }
}

/// Numbers with commas between them: `0.25,2,6`.
pub(crate) fn list(text: &str) -> Result<Vec<f64>, String> {
    text.split(',').map(number).collect()
}

/// Three numbers: `0,0,0.15`.
pub(crate) fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers = list(text)?;
    let count = numbers.len();
    numbers
        .try_into()
        .map_err(|_| format!("{count} numbers, wanted three with commas between them"))
}

/// Three signs: `1,-1,1`.
pub(crate) fn signs(text: &str) -> Result<[i64; 3], String> {
    let sign = |part: &str| match part.trim() {
        "1" | "+1" | "+" => Ok(1),
        "-1" | "-" => Ok(-1),
        other => Err(format!("`{other}` is neither 1 nor -1")),
    };
    let signs: Vec<i64> = text.split(',').map(sign).collect::<Result<_, _>>()?;
    let count = signs.len();
    signs
        .try_into()
        .map_err(|_| format!("{count} signs, wanted three with commas between them"))
}

/// Three counts: `32,32,16`, or one for all three.
pub(crate) fn counts(text: &str) -> Result<[u32; 3], String> {
    let count = |part: &str| {
        part.trim()
            .parse()
            .map_err(|_| format!("`{}` is not a count", part.trim()))
    };
    let counts: Vec<u32> = text.split(',').map(count).collect::<Result<_, _>>()?;
    match *counts {
        [one] => Ok([one; 3]),
        [x, y, z] => Ok([x, y, z]),
        _ => Err(format!("{} counts, wanted one or three", counts.len())),
    }
}

/// A rational function of `s`, coefficients from the highest power on: `18,1/0.005,0.4,18,1`, or a polynomial without
/// the stroke; `x` and `y` are the paper's servos.
pub(crate) fn transfer_function(text: &str) -> Result<TransferFunction, String> {
    match text.trim() {
        "x" => return Ok(printed(&paper::g_hx())),
        "y" => return Ok(printed(&paper::g_hy())),
        _ => {}
    }
    let (numerator, denominator) = text.split_once('/').unwrap_or((text, "1"));
    let coefficients = |text: &str| {
        list(text).map_err(|error| {
            format!("{error}; wanted x, y, or coefficients such as 18,1/0.005,0.4,18,1")
        })
    };
    Ok(TransferFunction {
        numerator: coefficients(numerator)?,
        denominator: coefficients(denominator)?,
    })
}

/// Least and greatest: `0..60`, or one number for both.
pub(crate) fn range(text: &str) -> Result<[f64; 2], String> {
    let (least, greatest) = text.split_once("..").unwrap_or((text, text));
    match (&*list(least)?, &*list(greatest)?) {
        (&[least], &[greatest]) => Ok([least, greatest]),
        _ => Err(format!("`{text}` is no range, wanted such as 0..60")),
    }
}

/// The coefficients of a function, for a request.
pub(crate) fn printed(function: &RationalFunction) -> TransferFunction {
    TransferFunction {
        numerator: function.numerator().coefficients().to_vec(),
        denominator: function.denominator().coefficients().to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_spelt_as_they_are_read() {
        let servo = transfer_function("18, 1 / 0.005, 0.4, 18, 1").unwrap();
        assert_eq!(servo, transfer_function("x").unwrap());
        assert_eq!(transfer_function("2").unwrap().denominator, [1.0]);
        for (text, what) in [
            (
                "1/2/3",
                "`2/3` is not a number; wanted x, y, or coefficients",
            ),
            ("z", "`z` is not a number; wanted x, y"),
            ("18,1/", "a number is missing; wanted"),
            ("1e999", "`1e999` is not a finite number"),
        ] {
            let error = transfer_function(text).unwrap_err();
            assert!(error.starts_with(what), "{error}");
        }
    }

    #[test]
    fn ranges_triples_signs_and_counts() {
        assert_eq!(range("0..60"), Ok([0.0, 60.0]));
        assert_eq!(range("5"), Ok([5.0, 5.0]));
        assert!(range("1,2..3").is_err() && range("..").is_err());
        assert_eq!(triple("-1, 2,3"), Ok([-1.0, 2.0, 3.0]));
        assert_eq!(
            triple("1,2").unwrap_err(),
            "2 numbers, wanted three with commas between them"
        );
        assert_eq!(signs("+,-,-1"), Ok([1, -1, -1]));
        assert!(signs("1,0,1").is_err() && signs("1,1").is_err());
        assert_eq!(counts("8"), Ok([8; 3]));
        assert_eq!(counts("1,2,3"), Ok([1, 2, 3]));
        assert!(counts("1,2").is_err() && counts("-1").is_err());
    }
}
