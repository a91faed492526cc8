#include "expectation.hpp"

#include <algorithm>

#include "chain.hpp"
#include "moments.hpp"

namespace pilotfish {

void e_step(Sizes sizes, const double* x, const int64_t* lengths, long M, Model model, Sums sums) {
  const int K = sizes.K;
  const Chain chain(K, model.log_initial, model.transitions, model.log_transitions);
  Densities densities(sizes, model.means, model.whiteners);
  Moments moments(sizes, model.means, sums.offsets, sums.scatters);
  const long width = chain.width(), longest = *std::max_element(lengths, lengths + M);
  Buffer log_emissions(longest * width, NEVER), gamma(longest * width), offsets(longest), mass(width, 0.0);
  std::fill_n(sums.first, K, 0.0);
  std::fill_n(sums.transitions, K * K, 0.0);
  for (long m = 0, begin = 0; m < M; begin += lengths[m++]) {
    const long T = lengths[m];
    densities.evaluate(x, begin, begin + T, log_emissions.data(), width);
    sums.log_likelihoods[m] = chain.forward(log_emissions.data(), T, gamma.data(), offsets.data());
    if (sums.log_likelihoods[m] == NEVER) continue;
    chain.backward(log_emissions.data(), T, gamma.data(), sums.transitions);
    for (int k = 0; k < K; ++k) sums.first[k] += gamma[k];
    for (long t = 0; t < T; ++t)
      for (long k = 0; k < width; ++k) mass[k] += gamma[t * width + k];
    moments.add(x, begin, begin + T, gamma.data(), width);
  }
  std::copy_n(mass.begin(), K, sums.mass);
  moments.finish();
}

}  // namespace pilotfish
