//! The best of all ways to settle several conflicts, when each combination is dear to judge.

/// The combination with the least cost: one number below `counts[n]` for conflict n; none when no combination has a cost.
///
/// 1. When there are no more than `most` combinations, all are judged, the one of zeros first.
/// 2. Else the conflicts are settled one after another, the others as they are best so far, beginning with zeros everywhere; it
///    ends after `most` judgements. The result need not be the best of all then.
///
/// # Errors
/// Those of `cost`.
pub fn choose<C: PartialOrd, E>(
    counts: &[usize],
    most: usize,
    mut cost: impl FnMut(&[usize]) -> Result<Option<C>, E>,
) -> Result<Option<Vec<usize>>, E> {
    let mut best: Option<(C, Vec<usize>)> = None;
    let mut judged = 0;
    let mut judge = |ways: &[usize], best: &mut Option<(C, Vec<usize>)>| -> Result<bool, E> {
        if judged >= most.max(1) {
            return Ok(false);
        }
        judged += 1;
        if let Some(cost) = cost(ways)?
            && best.as_ref().is_none_or(|(least, _)| cost < *least)
        {
            *best = Some((cost, ways.to_vec()));
        }
        Ok(true)
    };
    let mut ways = vec![0; counts.len()];
    let all = counts
        .iter()
        .try_fold(1_usize, |all, n| all.checked_mul(*n));
    if all.is_some_and(|all| all <= most) {
        while judge(&ways, &mut best)? && next(&mut ways, counts) {}
        return Ok(best.map(|b| b.1));
    }
    judge(&ways, &mut best)?;
    for (n, count) in counts.iter().enumerate() {
        for way in 1..*count {
            let mut ways = best.as_ref().map_or_else(|| ways.clone(), |b| b.1.clone());
            ways[n] = way;
            if !judge(&ways, &mut best)? {
                return Ok(best.map(|b| b.1));
            }
        }
    }
    Ok(best.map(|b| b.1))
}

/// Counts up, the first number fastest; false after the last combination.
fn next(ways: &mut [usize], counts: &[usize]) -> bool {
    for (way, count) in ways.iter_mut().zip(counts) {
        *way += 1;
        if *way < *count {
            return true;
        }
        *way = 0;
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Costs with a trap: the second conflict's best way depends on the first.
    fn cost(ways: &[usize]) -> Result<Option<f64>, ()> {
        Ok(match ways {
            [2, 1] => Some(1.0),
            [1, 0] => Some(2.0),
            [_, 2] => None,
            [a, b] => Some(10.0 + *a as f64 + *b as f64),
            _ => None,
        })
    }

    #[test]
    fn all_combinations_are_judged_when_they_are_few() {
        let mut seen = Vec::new();
        let best = choose(&[3, 3], 9, |ways| {
            seen.push(ways.to_vec());
            cost(ways)
        });
        assert_eq!(best, Ok(Some(vec![2, 1])));
        assert_eq!(seen.len(), 9);
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), 9);
    }

    #[test]
    fn many_conflicts_are_settled_one_after_another() {
        let mut seen = Vec::new();
        let best = choose(&[3, 3], 8, |ways| {
            seen.push(ways.to_vec());
            cost(ways)
        });
        assert_eq!(best, Ok(Some(vec![1, 0])));
        assert_eq!(seen, [[0, 0], [1, 0], [2, 0], [1, 1], [1, 2]]);
        let bounded = choose(&[3, 3], 2, cost);
        assert_eq!(bounded, Ok(Some(vec![1, 0])));
        assert_eq!(choose(&[2; 80], 1, |_| Ok::<_, ()>(None::<f64>)), Ok(None));
        assert_eq!(choose(&[], 5, |_| Ok::<_, ()>(Some(1.0))), Ok(Some(vec![])));
    }
}
