// Python bindings of the kernels of assistance and of products on S^3.
#include <nanobind/stl/tuple.h>

#include <cmath>
#include <limits>
#include <string>
#include <tuple>

#include "arrays.hpp"
#include "assistance.hpp"
#include "riemannian.hpp"

namespace pilotfish::python {
namespace {

using In1 = In<double, 1>;
using In2 = In<double, 2>;
using In3 = In<double, 3>;

void expect_number(double number, const char* name, double lowest = -LARGEST_NUMBER) {
  if (!(number >= lowest && number <= LARGEST_NUMBER))
    throw nb::value_error((std::string(name) + " is out of range").c_str());
}

void expect_pose(const Assistance& a, size_t scalars) {
  if ((a.D != a.E && a.D != a.E + 1) || a.D < a.scalar_start() || size_t(a.scalars()) != scalars)
    throw nb::value_error("the columns are no position, orientation and scalars");
}

void read_map(Assistance& a, const In2& matrix, const In1& shift, const In1& left, const In1& right) {
  expect(matrix, "matrix", {3, 3});
  expect(shift, "shift", {3});
  expect(left, "left", {4});
  expect(right, "right", {4});
  expect_finite(matrix, "matrix");
  expect_finite(shift, "shift");
  expect_finite(left, "left");
  expect_finite(right, "right");
  a.matrix = matrix.data(), a.shift = shift.data(), a.left = left.data(), a.right = right.data();
}

void read_model(Assistance& a, const In2& observed_means, const In3& whitening, const In2& actual_means,
                const In2& offsets, const In3& gains, const In3& fused_covariances) {
  const size_t K = observed_means.shape(0), D = a.D, E = a.E;
  expect_some(K, "observed_means");
  a.K = int(K);
  expect(observed_means, "observed_means", {K, D});
  expect(whitening, "whitening", {K, E, E});
  expect(actual_means, "actual_means", {K, D});
  expect(offsets, "offsets", {K, E});
  expect(gains, "gains", {K, E, E});
  expect(fused_covariances, "fused_covariances", {K, E, E});
  expect_finite(observed_means, "observed_means");
  expect_finite(whitening, "whitening");
  expect_finite(actual_means, "actual_means");
  expect_finite(offsets, "offsets");
  expect_finite(gains, "gains");
  expect_finite(fused_covariances, "fused_covariances");
  a.observed_means = observed_means.data(), a.whitening = whitening.data();
  a.actual_means = actual_means.data(), a.offsets = offsets.data(), a.gains = gains.data();
  a.fused_covariances = fused_covariances.data();
}

void read_filter(Assistance& a, const In2& transitions, const In2& hazards, double reset, const In2& belief,
                 const In1& before, const In1& now, double elapsed) {
  const size_t K = a.K, L = hazards.shape(0);
  expect_some(L, "hazards");
  a.L = int(L);
  expect(transitions, "transitions", {K, K});
  expect(hazards, "hazards", {L, K});
  expect(belief, "belief", {L, K});
  expect(before, "before", {K});
  expect(now, "now", {K});
  expect_finite(transitions, "transitions");
  expect_finite(hazards, "hazards");
  expect_finite(belief, "belief");
  expect_finite(before, "before");
  expect_finite(now, "now");
  expect_number(reset, "reset");
  if (!(elapsed == INFINITY)) expect_number(elapsed, "elapsed", 0.0);
  a.transitions = transitions.data(), a.hazards = hazards.data(), a.reset = reset;
  a.belief = belief.data(), a.before = before.data(), a.now = now.data(), a.elapsed = elapsed;
}

void read_settings(Assistance& a, const In1& variances, const In1& lower, const In1& upper) {
  expect(variances, "variances", {size_t(a.E)});
  expect(lower, "lower", {3});
  expect(upper, "upper", {3});
  expect_finite(variances, "variances");
  expect_finite(lower, "lower");
  expect_finite(upper, "upper");
  a.variances = variances.data(), a.lower = lower.data(), a.upper = upper.data();
  expect_number(a.full, "full");
  expect_number(a.none, "none");
  expect_number(a.speed, "speed");
  expect_number(a.acceleration, "acceleration");
  expect_number(a.angular_speed, "angular_speed");
  expect_number(a.angular_acceleration, "angular_acceleration");
  expect_number(a.period, "period", std::numeric_limits<double>::min());
}

void read_memory(Assistance& a, const In1& command, const In1& offset, const In1& pose, const In1& velocity,
                 const In1& desired, const In1& held_values, const In1& held_commands) {
  const size_t D = a.D, E = a.E, S = held_values.shape(0);
  expect_pose(a, S);
  expect(pose, "pose", {D});
  expect(velocity, "velocity", {E});
  expect(desired, "desired", {D});
  expect(held_commands, "held_commands", {S});
  expect_finite(command, "command");
  expect_finite(offset, "offset");
  expect_finite(pose, "pose");
  expect_finite(velocity, "velocity");
  expect_finite(desired, "desired");
  a.command = command.data(), a.offset = offset.data(), a.pose = pose.data(), a.velocity = velocity.data();
  a.desired = desired.data(), a.held_values = held_values.data(), a.held_commands = held_commands.data();
}

// Reads what the step is given; an empty pose stands for none.
void read_input(Assistance& a, const In1& hand, const In1& given_pose, const In2& given_covariance, double dt,
                int mode) {
  const size_t D = a.D, E = a.E;
  expect(hand, "hand", {D});
  expect_number(dt, "dt", std::numeric_limits<double>::min());
  if (mode < DIRECT || mode > AUTONOMOUS) throw nb::value_error("mode is not 0, 1 or 2");
  a.hand = hand.data(), a.dt = dt, a.mode = mode, a.given_pose = a.given_covariance = nullptr;
  if (given_pose.shape(0) == 0) {
    if (given_covariance.size()) throw nb::value_error("given_covariance has no pose");
    if (mode == AUTONOMOUS) throw nb::value_error("autonomous control needs the pose of its plan");
    return;
  }
  expect(given_pose, "given_pose", {D});
  expect(given_covariance, "given_covariance", {E, E});
  expect_finite(given_pose, "given_pose");
  expect_finite(given_covariance, "given_covariance");
  a.given_pose = given_pose.data(), a.given_covariance = given_covariance.data();
}

// Keeps the GIL: to release and acquire it would take longer than the work.
auto assistance_step(In2 matrix, In1 shift, In1 left, In1 right, In2 observed_means, In3 whitening,
                     In2 actual_means, In2 offsets, In3 gains, In3 fused_covariances, In2 transitions,
                     In2 hazards, double reset, In1 variances, In1 lower, In1 upper, double full, double none, double speed, double acceleration,
                     double angular_speed, double angular_acceleration, double period, In2 belief,
                     In1 before, In1 now, double elapsed, In1 command, In1 offset, In1 pose, In1 velocity,
                     In1 desired, In1 held_values, In1 held_commands, double authority, double blend_time,
                     double blend_duration, bool is_following, bool has_left, In1 hand, In1 given_pose, In2 given_covariance,
                     double dt, int mode, bool is_closed, bool is_current, bool has_changed) {
  Assistance a{};
  a.D = int(command.shape(0)), a.E = int(offset.shape(0));
  a.manifold.D = a.D;
  if (a.is_oriented()) a.manifold.orientation_starts = {3};
  read_memory(a, command, offset, pose, velocity, desired, held_values, held_commands);
  read_map(a, matrix, shift, left, right);
  read_model(a, observed_means, whitening, actual_means, offsets, gains, fused_covariances);
  read_filter(a, transitions, hazards, reset, belief, before, now, elapsed);
  a.full = full, a.none = none, a.speed = speed, a.acceleration = acceleration;
  a.angular_speed = angular_speed, a.angular_acceleration = angular_acceleration, a.period = period;
  read_settings(a, variances, lower, upper);
  read_input(a, hand, given_pose, given_covariance, dt, mode);
  expect_number(authority, "authority");
  expect_number(blend_time, "blend_time");
  expect_number(blend_duration, "blend_duration");
  a.authority = authority, a.blend_time = blend_time, a.blend_duration = blend_duration;
  a.is_following = is_following, a.has_left = has_left, a.is_closed = is_closed, a.is_current = is_current,
  a.has_changed = has_changed;

  // One array for all numbers: to make an array takes as long as a third of the step.
  const size_t K = a.K, D = a.D, E = a.E, S = a.scalars();
  Out numbers = empty<Out>({3 * K + 3 * D + 2 * E + S + E * E});
  Out new_belief = is_observation_due(a) ? empty<Out>({size_t(a.L), K}) : Out();
  double* next = numbers.data();
  const auto take = [&next](size_t size) { return (next += size) - size; };
  AssistanceResult r{};
  r.belief = new_belief.data();
  r.before = take(K), r.now = take(K), r.command = take(D), r.offset = take(E), r.pose = take(D);
  r.velocity = take(E), r.desired = take(D), r.held_values = take(S), r.probabilities = take(K);
  r.covariance = take(E * E);
  {
    SubnormalsFlushed subnormals;
    pilotfish::assistance_step(a, r);
  }
  nb::object observed = is_observation_due(a) ? nb::cast(new_belief) : nb::none();
  return std::make_tuple(observed, numbers, r.elapsed, r.authority, r.blend_time, r.blend_duration, r.is_following,
                         r.has_left);
}

auto riemannian_product(In<double, 3> means, In<double, 4> covariances, In<double, 4> precision_cholesky,
                        In<int64_t, 1> orientation_starts) {
  const size_t P = means.shape(0), K = means.shape(1), D = means.shape(2);
  expect_some(P, "means");
  expect_some(K, "the second axis of means");
  expect_some(D, "the last axis of means");
  const Manifold manifold{int(D), read_orientation_starts(orientation_starts, D)};
  const size_t E = manifold.E();
  expect(covariances, "covariances", {P, K, E, E});
  expect(precision_cholesky, "precision_cholesky", {P, K, E, E});
  expect_finite(means, "means");
  expect_finite(covariances, "covariances");
  expect_finite(precision_cholesky, "precision_cholesky");
  Out product_means = empty<Out>({K, D}), product_covariances = empty<Out>({K, E, E});
  {
    ReleasedInterpreter run;
    const FrameGaussians given{int(P), int(K), means.data(), covariances.data(), precision_cholesky.data()};
    pilotfish::riemannian_product(manifold, given, product_means.data(), product_covariances.data());
  }
  return std::make_tuple(product_means, product_covariances);
}

}  // namespace

void bind_assistance(nb::module_& module) {
  module.def("assistance_step", &assistance_step);
  module.def("riemannian_product", &riemannian_product);
}

}  // namespace pilotfish::python
