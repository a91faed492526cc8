// Python bindings of the kernels. They take and return C-contiguous arrays and release the GIL in between.
// The module is built for two instruction sets; kernels/compiled.py selects one and names the results.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>

#include "arrays.hpp"
#include "cholesky.hpp"
#include "e_steps.hpp"
#include "impedance.hpp"
#include "markov.hpp"
#include "riccati.hpp"
#include "semi_markov.hpp"
#include "semi_tied.hpp"

#ifndef PILOTFISH_MODULE
#error "PILOTFISH_MODULE names the extension module"
#endif

namespace nb = nanobind;

namespace pilotfish::python {

void bind_assistance(nb::module_& module), bind_streams(nb::module_& module);  // in module_*.cpp

namespace {

Sizes read_sizes(const In<double, 3>& x, const In<double, 3>& means, const In<double, 4>& precision_cholesky,
                 const In<int64_t, 1>& orientation_starts) {
  const size_t P = x.shape(0), D = x.shape(2), K = means.shape(1);
  expect_some(D, "the last axis of x");
  expect_some(K, "means");
  expect(means, "means", {P, K, D});
  const Sizes sizes{int(P), long(x.shape(1)), int(K), int(D), read_orientation_starts(orientation_starts, D)};
  const size_t E = sizes.E();
  expect(precision_cholesky, "precision_cholesky", {P, K, E, E});
  expect_finite(x, "x");
  expect_finite(means, "means");
  expect_finite(precision_cholesky, "precision_cholesky");
  for (size_t k = 0; k < P * K; ++k)
    for (size_t e = 0; e < E; ++e)
      if (!(precision_cholesky.data()[(k * E + e) * E + e] >= std::numeric_limits<double>::min()))
        throw nb::value_error("precision_cholesky has a diagonal that is not positive");
  return sizes;
}

Demonstrations demonstrations(const In<double, 3>& x, const In<int64_t, 1>& lengths) {
  const size_t M = lengths.shape(0);
  const int64_t N = x.shape(1);
  expect_some(M, "lengths");
  int64_t sum = 0;
  for (size_t m = 0; m < M; ++m) {
    if (lengths(m) < 1 || lengths(m) > N) throw nb::value_error("lengths are not between 1 and N");
    sum += lengths(m);
  }
  if (sum != N) throw nb::value_error("the sum of lengths is not the number of datapoints of x");
  return {x.data(), lengths.data(), long(M)};
}

void expect_chain(size_t K, const In<double, 1>& log_initial, const In<double, 2>& log_transitions) {
  expect(log_initial, "log_initial", {K});
  expect(log_transitions, "log_transitions", {K, K});
  expect_logarithms(log_initial, "log_initial");
  expect_logarithms(log_transitions, "log_transitions");
}

SemiMarkovTables read_tables(size_t K, const In<double, 1>& log_initial, const In<double, 2>& log_transitions,
                             const In<double, 3>& log_segment_weights,
                             const In<double, 2>& log_tail_weights) {
  const size_t S = log_segment_weights.shape(1);
  expect_some(S, "the second axis of log_segment_weights");
  expect_chain(K, log_initial, log_transitions);
  expect(log_segment_weights, "log_segment_weights", {4, S, K});
  expect(log_tail_weights, "log_tail_weights", {2, K});
  expect_logarithms(log_segment_weights, "log_segment_weights");
  expect_logarithms(log_tail_weights, "log_tail_weights");
  return {int(K),
          long(S),
          log_initial.data(),
          log_transitions.data(),
          log_segment_weights.data(),
          log_tail_weights.data()};
}

void expect_emissions(const In<double, 2>& log_emissions) {
  expect_some(log_emissions.shape(0), "log_emissions");
  expect_some(log_emissions.shape(1), "the last axis of log_emissions");
  expect_logarithms(log_emissions, "log_emissions");
}

Out log_emissions(In<double, 3> x, In<double, 3> means, In<double, 4> precision_cholesky,
                  In<int64_t, 1> orientation_starts) {
  const Sizes sizes = read_sizes(x, means, precision_cholesky, orientation_starts);
  Out result = empty<Out>({size_t(sizes.N), size_t(sizes.K)});
  {
    ReleasedInterpreter run;
    Densities(sizes, means.data(), precision_cholesky.data())
        .evaluate(x.data(), 0, sizes.N, result.data(), sizes.K);
  }
  return result;
}

auto e_step(In<double, 3> x, In<int64_t, 1> lengths, In<double, 1> log_initial, In<double, 2> transitions,
            In<double, 2> log_transitions, In<double, 3> means, In<double, 4> precision_cholesky,
            In<int64_t, 1> orientation_starts, int threads, In<double, 1> log_final) {
  const Sizes sizes = read_sizes(x, means, precision_cholesky, orientation_starts);
  Demonstrations data = demonstrations(x, lengths);
  expect_threads(threads);
  expect(log_final, "log_final", {size_t(sizes.K)});
  for (int k = 0; k < sizes.K; ++k)
    if (!(log_final(k) < INFINITY)) throw nb::value_error("log_final has a value that is not below infinity");
  data.log_final = log_final.data();
  const size_t M = data.M, P = sizes.P, K = sizes.K, E = sizes.E();
  expect(transitions, "transitions", {K, K});
  expect_chain(K, log_initial, log_transitions);
  Out log_likelihoods = empty<Out>({M}), counts = empty<Out>({K}), initial_counts = empty<Out>({K});
  Out transition_counts = empty<Out>({K, K});
  Out offsets = empty<Out>({P, K, E}), scatter_matrices = empty<Out>({P, K, E, E});
  const Sums sums{log_likelihoods.data(),
                  counts.data(),
                  initial_counts.data(),
                  transition_counts.data(),
                  offsets.data(),
                  scatter_matrices.data(),
                  nullptr,
                  nullptr};
  {
    ReleasedInterpreter run;
    const Chain chain(int(K), log_initial.data(), transitions.data(), log_transitions.data());
    pilotfish::e_step(sizes, data, chain, {means.data(), precision_cholesky.data()}, threads, sums);
  }
  return std::make_tuple(log_likelihoods, counts, initial_counts, transition_counts, offsets, scatter_matrices);
}

auto semi_markov_e_step(In<double, 3> x, In<int64_t, 1> lengths, In<double, 1> log_initial,
                        In<double, 2> log_transitions, In<double, 3> log_segment_weights,
                        In<double, 2> log_tail_weights, In<double, 3> means, In<double, 4> precision_cholesky,
                        In<int64_t, 1> orientation_starts, int threads) {
  const Sizes sizes = read_sizes(x, means, precision_cholesky, orientation_starts);
  const Demonstrations data = demonstrations(x, lengths);
  expect_threads(threads);
  const size_t M = data.M, P = sizes.P, K = sizes.K, E = sizes.E(), S = log_segment_weights.shape(1);
  const SemiMarkovTables tables =
      read_tables(K, log_initial, log_transitions, log_segment_weights, log_tail_weights);
  Out log_likelihoods = empty<Out>({M}), counts = empty<Out>({K}), initial_counts = empty<Out>({K});
  Out transition_counts = empty<Out>({K, K}), segments = empty<Out>({4, S, K}),
      long_segment_counts = empty<Out>({2, K});
  Out offsets = empty<Out>({P, K, E}), scatter_matrices = empty<Out>({P, K, E, E});
  const Sums sums{log_likelihoods.data(),   counts.data(),     initial_counts.data(),
                  transition_counts.data(), offsets.data(),    scatter_matrices.data(),
                  segments.data(),          long_segment_counts.data()};
  {
    ReleasedInterpreter run;
    const SemiMarkovChain chain(tables);
    pilotfish::e_step(sizes, data, chain, {means.data(), precision_cholesky.data()}, threads, sums);
  }
  return std::make_tuple(log_likelihoods, counts, initial_counts, transition_counts, segments, long_segment_counts,
                         offsets, scatter_matrices);
}

auto forward_backward(In<double, 2> log_emissions, In<double, 1> log_initial, In<double, 2> transitions,
                      In<double, 2> log_transitions) {
  const size_t T = log_emissions.shape(0), K = log_emissions.shape(1);
  expect_emissions(log_emissions);
  expect(transitions, "transitions", {K, K});
  expect_chain(K, log_initial, log_transitions);
  Out smoothed_state_probs = empty<Out>({T, K}), transition_counts = empty<Out>({K, K}),
      log_forward = empty<Out>({T, K});
  double log_likelihood;
  {
    ReleasedInterpreter run;
    const Chain chain(int(K), log_initial.data(), transitions.data(), log_transitions.data());
    log_likelihood =
        pilotfish::forward_backward(chain, log_emissions.data(), long(T), smoothed_state_probs.data(),
                                    transition_counts.data(), log_forward.data());
  }
  return std::make_tuple(log_likelihood, smoothed_state_probs, transition_counts, log_forward);
}

auto viterbi(In<double, 2> log_emissions, In<double, 1> log_initial, In<double, 2> log_transitions) {
  const size_t T = log_emissions.shape(0), K = log_emissions.shape(1);
  expect_emissions(log_emissions);
  expect_chain(K, log_initial, log_transitions);
  States states = empty<States>({T});
  double log_probability;
  {
    ReleasedInterpreter run;
    log_probability = pilotfish::viterbi(int(K), long(T), log_emissions.data(), long(K), log_initial.data(),
                                         log_transitions.data(), states.data());
  }
  return std::make_tuple(states, log_probability);
}

auto semi_markov_forward_backward(In<double, 2> log_emissions, In<double, 1> log_initial,
                                  In<double, 2> log_transitions, In<double, 3> log_segment_weights,
                                  In<double, 2> log_tail_weights) {
  const size_t T = log_emissions.shape(0), K = log_emissions.shape(1), S = log_segment_weights.shape(1);
  expect_emissions(log_emissions);
  const SemiMarkovTables tables =
      read_tables(K, log_initial, log_transitions, log_segment_weights, log_tail_weights);
  Out smoothed_state_probs = empty<Out>({T, K}), transition_counts = empty<Out>({K, K});
  Out segments = empty<Out>({4, S, K}), long_segment_counts = empty<Out>({2, K});
  for (const Out& result : {smoothed_state_probs, transition_counts, segments, long_segment_counts})
    std::fill_n(result.data(), result.size(), 0.0);
  double log_likelihood;
  {
    ReleasedInterpreter run;
    const SemiMarkovChain chain(tables);
    SemiMarkovInference inference(chain, long(T));
    log_likelihood = inference.infer(log_emissions.data(), long(T), smoothed_state_probs.data());
    inference.add_to(transition_counts.data(), segments.data(), long_segment_counts.data());
  }
  return std::make_tuple(log_likelihood, smoothed_state_probs, transition_counts, segments, long_segment_counts);
}

auto semi_markov_forward(In<double, 2> log_emissions, In<double, 1> log_initial,
                         In<double, 2> log_transitions, In<double, 3> log_segment_weights,
                         In<double, 2> log_tail_weights) {
  const size_t T = log_emissions.shape(0), K = log_emissions.shape(1);
  expect_emissions(log_emissions);
  const SemiMarkovTables tables =
      read_tables(K, log_initial, log_transitions, log_segment_weights, log_tail_weights);
  Out log_segment_ends = empty<Out>({T, K}), log_forward = empty<Out>({T, K});
  {
    ReleasedInterpreter run;
    pilotfish::forward(SemiMarkovChain(tables), log_emissions.data(), long(T), log_segment_ends.data(),
                       log_forward.data());
  }
  return std::make_tuple(log_segment_ends, log_forward);
}

auto semi_markov_viterbi(In<double, 2> log_emissions, In<double, 1> log_initial,
                         In<double, 2> log_transitions, In<double, 3> log_segment_weights,
                         In<double, 2> log_tail_weights) {
  const size_t T = log_emissions.shape(0), K = log_emissions.shape(1);
  expect_emissions(log_emissions);
  const SemiMarkovTables tables =
      read_tables(K, log_initial, log_transitions, log_segment_weights, log_tail_weights);
  States states = empty<States>({T});
  double log_probability;
  {
    ReleasedInterpreter run;
    log_probability =
        pilotfish::viterbi(SemiMarkovChain(tables), log_emissions.data(), long(T), states.data());
  }
  return std::make_tuple(states, log_probability);
}

auto riccati(In<double, 3> A, In<double, 3> B, In<double, 3> weights, In<double, 2> targets,
             In<double, 2> control_cost) {
  const size_t T = targets.shape(0), n = targets.shape(1), m = B.shape(2), S = A.shape(0);
  expect_some(T, "targets");
  expect_some(n, "the last axis of targets");
  expect_some(m, "the last axis of B");
  if (S != 1 && S + 1 != T)
    throw nb::value_error("A and B have neither one matrix nor one for each step but the last");
  expect(A, "A", {S, n, n});
  expect(B, "B", {S, n, m});
  expect(weights, "weights", {T, n, n});
  expect(control_cost, "control_cost", {m, m});
  expect_finite(A, "A");
  expect_finite(B, "B");
  expect_finite(weights, "weights");
  expect_finite(targets, "targets");
  expect_finite(control_cost, "control_cost");
  Out gains = empty<Out>({T - 1, m, n}), feedforwards = empty<Out>({T - 1, m});
  Out values = empty<Out>({T, n, n}), gradients = empty<Out>({T, n});
  const Tracking problem{long(T),        int(n),         int(m),
                         S != 1,         A.data(),       B.data(),
                         weights.data(), targets.data(), control_cost.data()};
  long failed_index;
  {
    ReleasedInterpreter run;
    failed_index = pilotfish::riccati(
        problem, Gains{gains.data(), feedforwards.data(), values.data(), gradients.data()});
  }
  return std::make_tuple(failed_index, gains, feedforwards, values, gradients);
}

auto semi_tied_sweeps(In<double, 3> covariances, In<double, 1> counts, In<double, 2> transform, int sweeps) {
  const size_t K = covariances.shape(0), D = transform.shape(0);
  expect_some(D, "transform");
  expect(transform, "transform", {D, D});
  expect(covariances, "covariances", {K, D, D});
  expect(counts, "counts", {K});
  expect_finite(covariances, "covariances");
  expect_finite(counts, "counts");
  expect_finite(transform, "transform");
  Out result = empty<Out>({D, D});
  std::copy_n(transform.data(), D * D, result.data());
  int failed_index;
  {
    ReleasedInterpreter run;
    failed_index =
        pilotfish::semi_tied_sweeps(int(K), int(D), covariances.data(), counts.data(), result.data(), sweeps);
  }
  return std::make_tuple(failed_index, result);
}

auto precision_cholesky(In<double, 3> covariances) {
  const size_t K = covariances.shape(0), D = covariances.shape(1);
  expect_some(K, "covariances");
  expect_some(D, "the last axis of covariances");
  expect(covariances, "covariances", {K, D, D});
  Out result = empty<Out>({K, D, D});
  long failed_index;
  {
    ReleasedInterpreter run;
    failed_index = pilotfish::precision_cholesky(long(K), int(D), covariances.data(), result.data());
  }
  return std::make_tuple(failed_index, result);
}

// Keeps the GIL: in a control loop, to acquire it again would take longer than the work.
auto impedance_torque(In<double, 1> stiffness, In<double, 1> damping, In<double, 1> posture,
                      double posture_stiffness, double joint_damping, double force_limit, double moment_limit,
                      double min_singular_value, double limit_margin, double limit_stiffness,
                      In<double, 1> lower, In<double, 1> upper, In<double, 1> torque_limit, In<double, 1> q,
                      In<double, 1> velocity, In<double, 1> position, In<double, 1> quaternion,
                      In<double, 2> jacobian, In<double, 1> bias, In<double, 1> target_position,
                      In<double, 1> target_quaternion, In<double, 1> twist) {
  const size_t n = q.shape(0);
  expect_some(n, "q");
  if (n > MAX_JOINTS) throw nb::value_error("q has more than 16 entries");
  for (const auto* vector : {&stiffness, &damping, &twist})
    expect(*vector, "stiffness, damping or twist", {6});
  for (const auto* vector : {&position, &target_position}) expect(*vector, "position", {3});
  for (const auto* vector : {&quaternion, &target_quaternion}) expect(*vector, "quaternion", {4});
  for (const auto* vector : {&posture, &lower, &upper, &torque_limit, &velocity, &bias})
    expect(*vector, "posture, a limit, velocity or bias", {n});
  expect(jacobian, "jacobian", {6, n});
  const Arm arm{int(n),
                stiffness.data(),
                damping.data(),
                posture.data(),
                posture_stiffness,
                joint_damping,
                force_limit,
                moment_limit,
                min_singular_value,
                limit_margin,
                limit_stiffness,
                lower.data(),
                upper.data(),
                torque_limit.data(),
                q.data(),
                velocity.data(),
                position.data(),
                quaternion.data(),
                jacobian.data(),
                bias.data(),
                target_position.data(),
                target_quaternion.data(),
                twist.data()};
  Out torque = empty<Out>({n}), wrench = empty<Out>({6});
  const double torque_fraction = pilotfish::impedance_torque(arm, torque.data(), wrench.data());
  return std::make_tuple(torque, wrench, torque_fraction);
}

#ifdef PILOTFISH_KNOWS_V3
bool supports_v3() {
  // All extensions of x86-64-v3 beyond the baseline; a hypervisor may mask any of them.
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
         __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("f16c") &&
         __builtin_cpu_supports("lzcnt") && __builtin_cpu_supports("movbe");
}
#else
bool supports_v3() { return false; }
#endif

}  // namespace
}  // namespace pilotfish::python

NB_MODULE(PILOTFISH_MODULE, module) {
  namespace python = pilotfish::python;
  module.def("log_emissions", &python::log_emissions);
  module.def("e_step", &python::e_step);
  module.def("forward_backward", &python::forward_backward);
  module.def("impedance_torque", &python::impedance_torque);
  module.def("viterbi", &python::viterbi);
  module.def("semi_markov_forward_backward", &python::semi_markov_forward_backward);
  module.def("semi_markov_viterbi", &python::semi_markov_viterbi);
  module.def("semi_markov_forward", &python::semi_markov_forward);
  module.def("semi_markov_e_step", &python::semi_markov_e_step);
  module.def("riccati", &python::riccati);
  python::bind_assistance(module), python::bind_streams(module);
  module.def("semi_tied_sweeps", &python::semi_tied_sweeps);
  module.def("precision_cholesky", &python::precision_cholesky);
  module.def("supports_v3", &python::supports_v3);
}
