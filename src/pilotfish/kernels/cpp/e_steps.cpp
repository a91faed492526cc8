#include "e_steps.hpp"

#include <algorithm>

#include "moments.hpp"
#include "parallel.hpp"
#include "scaled_forward_backward.hpp"

namespace pilotfish {

namespace {

// Smallest number of multiplications of a group: about 1 ms, while a thread starts in 0.05 ms.
constexpr double MIN_GROUP_WORK = 4e6;

// Relative to the largest state probability in a demonstration; already 1e-24 of it is lost in rounding.
constexpr double NEGLIGIBLE = 1e-30;

// Sums over the demonstrations of one group: in the caller's arrays for the first group, else in its own.
class GroupSums {
 public:
  GroupSums(const Sizes& sizes, long S) : sizes_(sizes), S_(S) {}

  Sums begin(Sums given, bool own) {
    at_ = given;
    if (own) {
      numbers_.resize(count());
      double* next = numbers_.data();
      for_each(at_, [&](double*& sum, size_t size) { sum = next, next += size; });
    }
    for_each(at_, [&](double*& sum, size_t size) { std::fill_n(sum, size, 0.0); });
    return at_;
  }

  void add_to(Sums whole) const {
    const double* next = numbers_.data();
    for_each(whole, [&](double*& sum, size_t size) {
      for (size_t i = 0; i < size; ++i) sum[i] += next[i];
      next += size;
    });
  }

 private:
  template <typename Visit>
  void for_each(Sums& sums, Visit visit) const {
    const size_t P = sizes_.P, K = sizes_.K, E = sizes_.E(), S = S_;
    visit(sums.counts, K);
    visit(sums.initial_counts, K);
    visit(sums.transition_counts, K * K);
    visit(sums.offsets, P * K * E);
    visit(sums.scatter_matrices, P * K * E * E);
    visit(sums.segments, 4 * S * K);
    visit(sums.long_segment_counts, S > 0 ? 2 * K : 0);
  }

  size_t count() const {
    size_t all = 0;
    Sums none{};
    for_each(none, [&](double*&, size_t size) { all += size; });
    return all;
  }

  const Sizes& sizes_;
  long S_;
  Sums at_{};
  Buffer numbers_;
};

void add_expected(const MarkovInference& inference, Sums sums) {
  const Buffer& transition_counts = inference.transition_counts();
  for (size_t i = 0; i < transition_counts.size(); ++i) sums.transition_counts[i] += transition_counts[i];
}

void add_expected(const SemiMarkovInference& inference, Sums sums) {
  inference.add_to(sums.transition_counts, sums.segments, sums.long_segment_counts);
}

// Adds the statistics of the demonstrations of one group.
template <typename Inference, typename AnyChain>
void add_group(const Sizes& sizes, Demonstrations data, Group group, const AnyChain& chain,
               Gaussians gaussians, Sums sums) {
  const int K = sizes.K;
  const int64_t* lengths = data.lengths;
  const long width = chain.width(),
             max_duration = *std::max_element(lengths + group.first, lengths + group.last);
  Densities densities(sizes, gaussians.means, gaussians.precision_cholesky);
  Moments moments(sizes, gaussians.means, sums.offsets, sums.scatter_matrices);
  Inference inference(chain, max_duration);
  Buffer log_emissions(max_duration * width, NEVER), gamma(max_duration * width), counts(width, 0.0),
      min_weights(width);
  for (long m = group.first, begin = group.begin; m < group.last; begin += lengths[m++]) {
    const long T = lengths[m];
    densities.evaluate(data.x, begin, begin + T, log_emissions.data(), width);
    if (data.log_final)
      for (int k = 0; k < K; ++k) log_emissions[(T - 1) * width + k] += data.log_final[k];
    sums.log_likelihoods[m] = inference.infer(log_emissions.data(), T, gamma.data());
    if (sums.log_likelihoods[m] == NEVER) continue;
    for (int k = 0; k < K; ++k) sums.initial_counts[k] += gamma[k];
    std::fill(min_weights.begin(), min_weights.end(), 0.0);
    for (long t = 0; t < T; ++t)
      for (long k = 0; k < width; ++k) {
        counts[k] += gamma[t * width + k];
        min_weights[k] = std::max(min_weights[k], NEGLIGIBLE * gamma[t * width + k]);
      }
    moments.add(data.x, begin, begin + T, gamma.data(), width, min_weights.data());
  }
  std::copy_n(counts.begin(), K, sums.counts);
  moments.finish();
  add_expected(inference, sums);
}

// Returns the approximate number of multiplications of a step.
double work(const Sizes& sizes, const Chain&) {
  const double E = sizes.E();
  return sizes.K * (sizes.P * E * E + 4.0 * sizes.K);
}

double work(const Sizes& sizes, const SemiMarkovChain& chain) {
  const double E = sizes.E(), max_duration = std::min(chain.max_duration(), sizes.N);
  return sizes.K * (sizes.P * E * E + 15.0 * (max_duration + sizes.K));
}

template <typename Inference, typename AnyChain>
void add_all(const Sizes& sizes, Demonstrations data, const AnyChain& chain, Gaussians gaussians, long S,
             int threads, Sums sums) {
  const auto groups = split_groups(data.lengths, data.M, MIN_GROUP_WORK / work(sizes, chain));
  std::vector<GroupSums> parts(groups.size(), GroupSums(sizes, S));
  run_groups(int(groups.size()), threads, [&](int g) {
    add_group<Inference>(sizes, data, groups[g], chain, gaussians, parts[g].begin(sums, g > 0));
  });
  for (size_t g = 1; g < groups.size(); ++g) parts[g].add_to(sums);
}

}  // namespace

void e_step(const Sizes& sizes, Demonstrations data, const Chain& chain, Gaussians gaussians, int threads,
            Sums sums) {
  add_all<MarkovInference>(sizes, data, chain, gaussians, 0, threads, sums);
}

void e_step(const Sizes& sizes, Demonstrations data, const SemiMarkovChain& chain, Gaussians gaussians,
            int threads, Sums sums) {
  add_all<SemiMarkovInference>(sizes, data, chain, gaussians, chain.max_duration(), threads, sums);
}

}  // namespace pilotfish
