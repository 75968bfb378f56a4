//! A layer of a network: every output is a sum over all inputs.

/// Inputs that are added together: a pass over the outputs costs more than its sums.
const TOGETHER: usize = 4;

/// Weights and biases of a layer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dense {
    outputs: usize,
    /// `inputs x outputs`, an input's row after the other.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Dense {
    /// `weights` are `inputs x outputs`; there are as many biases as outputs.
    pub fn new(weights: Vec<f32>, bias: Vec<f32>) -> Self {
        Self { outputs: bias.len(), weights, bias }
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// The outputs, before any activation. Inputs of zero, about half of those of a hidden layer, cost nothing.
    pub fn apply(&self, inputs: &[f32], outputs: &mut Vec<f32>) {
        outputs.clone_from(&self.bias);
        let mut group = [(0.0, &self.weights[..0]); TOGETHER];
        let mut filled = 0;
        for (input, row) in inputs.iter().zip(self.weights.chunks_exact(self.outputs)) {
            if *input == 0.0 {
                continue;
            }
            group[filled] = (*input, row);
            filled += 1;
            if filled == TOGETHER {
                add(group, outputs);
                filled = 0;
            }
        }
        for (input, row) in &group[..filled] {
            outputs.iter_mut().zip(*row).for_each(|(sum, weight)| *sum += input * weight);
        }
    }
}

fn add([(a, row_a), (b, row_b), (c, row_c), (d, row_d)]: [(f32, &[f32]); TOGETHER], outputs: &mut [f32]) {
    for ((((sum, of_a), of_b), of_c), of_d) in outputs.iter_mut().zip(row_a).zip(row_b).zip(row_c).zip(row_d) {
        *sum += (a * of_a + b * of_b) + (c * of_c + d * of_d);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_sums_over_all_inputs() {
        for inputs in 1..12 {
            let weights: Vec<f32> = (0..3 * inputs).map(|i| (i % 7) as f32 - 2.0).collect();
            let given: Vec<f32> = (0..inputs).map(|i| if i % 3 == 1 { 0.0 } else { i as f32 - 4.5 }).collect();
            let layer = Dense::new(weights.clone(), vec![0.5, -1.0, 2.0]);
            let mut found = Vec::new();
            layer.apply(&given, &mut found);
            for (output, bias) in [0.5, -1.0, 2.0].into_iter().enumerate() {
                let expected: f32 = bias + (0..inputs).map(|i| given[i] * weights[3 * i + output]).sum::<f32>();
                assert!((found[output] - expected).abs() < 1e-4, "{inputs} {output}: {found:?} {expected}");
            }
        }
    }
}
