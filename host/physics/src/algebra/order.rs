//! An order of elimination that leaves a sparse factor sparse: approximate minimum degree.
//!
//! Eliminating an unknown joins all that are beside it. The graph that is left is kept as a quotient (George and Liu, 1981): an
//! eliminated unknown stands for the clique of those around it, so that nothing is stored twice. Next is always the unknown that
//! would join the fewest, by an upper bound that is cheap to keep (Amestoy, Davis and Duff, "An approximate minimum degree ordering
//! algorithm", SIAM J. Matrix Anal. Appl. 17, 1996; without its merging of unknowns that are alike, which meshes of some thousand
//! nodes do not need).

const NONE: u32 = u32::MAX;

/// The unknowns in an order of elimination, from the unknowns beside each: both of a pair have the other, none has itself or
/// another twice.
pub fn minimum_degree(mut beside: Vec<Vec<u32>>) -> Vec<u32> {
    let count = beside.len();
    // Cliques beside each unknown, and those around each clique, which is named by the unknown that was eliminated.
    let (mut cliques, mut around) = (vec![Vec::<u32>::new(); count], vec![Vec::<u32>::new(); count]);
    let mut queue = Queue::new(beside.iter().map(Vec::len).collect());
    let (mut joined, mut counted, mut outside) = (vec![NONE; count], vec![NONE; count], vec![0; count]);
    let mut order = Vec::with_capacity(count);
    while let Some(pivot) = queue.pop() {
        order.push(pivot);
        joined[pivot as usize] = pivot;
        let absorbed = std::mem::take(&mut cliques[pivot as usize]);
        let mut clique = std::mem::take(&mut beside[pivot as usize]);
        absorbed.iter().for_each(|other| clique.append(&mut around[*other as usize]));
        clique.retain(|i| std::mem::replace(&mut joined[*i as usize], pivot) != pivot);
        // How many of each clique nearby are not in the new one.
        for other in clique.iter().flat_map(|i| &cliques[*i as usize]).map(|other| *other as usize) {
            if counted[other] != pivot {
                (counted[other], outside[other]) = (pivot, around[other].len());
            }
            outside[other] = outside[other].saturating_sub(1);
        }
        for i in clique.iter().map(|i| *i as usize) {
            // Cliques within the new one say nothing more.
            cliques[i].retain(|other| outside[*other as usize] > 0);
            beside[i].retain(|other| joined[*other as usize] != pivot);
            let others: usize = cliques[i].iter().map(|other| outside[*other as usize]).sum();
            let more = clique.len() - 1;
            let bound = (beside[i].len() + others + more).min(queue.degree[i] + more).min(count - order.len() - 1);
            queue.set(i, bound);
            cliques[i].push(pivot);
        }
        around[pivot as usize] = clique;
    }
    order
}

/// Unknowns by degree.
struct Queue {
    degree: Vec<usize>,
    /// Unknowns of each degree, and some that had it before.
    of_degree: Vec<Vec<u32>>,
    least: usize,
}

/// Degree of an unknown that is eliminated.
const DONE: usize = usize::MAX;

impl Queue {
    fn new(degree: Vec<usize>) -> Self {
        let mut of_degree = vec![Vec::new(); degree.len()];
        for (i, degree) in degree.iter().enumerate().rev() {
            of_degree[*degree].push(i as u32);
        }
        Self { degree, of_degree, least: 0 }
    }

    fn set(&mut self, i: usize, degree: usize) {
        self.degree[i] = degree;
        self.of_degree[degree].push(i as u32);
        self.least = self.least.min(degree);
    }

    fn pop(&mut self) -> Option<u32> {
        while let Some(all) = self.of_degree.get_mut(self.least) {
            match all.pop() {
                Some(i) if self.degree[i as usize] == self.least => {
                    self.degree[i as usize] = DONE;
                    return Some(i);
                }
                Some(_) => {}
                None => self.least += 1,
            }
        }
        None
    }
}
