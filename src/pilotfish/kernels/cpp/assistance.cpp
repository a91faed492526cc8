#include "assistance.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "target_motion.hpp"

namespace pilotfish {

namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using MatrixView = Eigen::Map<const Matrix>;

constexpr double MAX_COORDINATE = 1e4, MIN_NORM = 0.5, MAX_NORM = 2.0;  // of hands; beyond, a fault
constexpr double MAX_RATE = 2.0;                                        // of authority, per second
constexpr double SCALAR_TOLERANCE = 0.1;
constexpr double ROUNDING = 1e-9;  // of a period
constexpr double MAX_STEPS = 100.0;

bool is_valid_hand(const Assistance& a) {
  for (int i = 0; i < a.D; ++i)
    if (!(std::abs(a.hand[i]) <= MAX_COORDINATE)) return false;
  if (!a.is_oriented()) return true;
  const double* q = a.hand + 3;
  const double squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return MIN_NORM * MIN_NORM <= squared && squared <= MAX_NORM * MAX_NORM;
}

void map_hand(const Assistance& a, double* x) {
  std::copy_n(a.hand, a.D, x);
  for (int i = 0; i < 3; ++i) {
    const double* row = a.matrix + 3 * i;
    x[i] = row[0] * a.hand[0] + row[1] * a.hand[1] + row[2] * a.hand[2] + a.shift[i];
  }
  if (!a.is_oriented()) return;
  double* q = x + 3;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; ++i) q[i] /= length;
  multiply(a.left, q, q);
  multiply(q, a.right, q);
}

// The command compared with every state of the scene observed.
struct Comparison {
  Matrix deviations;         // (K, E)
  Vector log_likelihoods;    // (K), up to a common constant
  double coverage_distance;  // from what the demonstrations covered
};

Comparison compare(const Assistance& a, const double* x) {
  const int width = a.E - a.scalars(), position = a.is_oriented() ? width - 3 : width;
  Comparison comparison{Matrix(a.K, a.E), Vector(a.K), 0.0};
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < a.K; ++k) {
    double* e = comparison.deviations.row(k).data();
    deviation(a.manifold, a.observed_means + k * a.D, x, e);
    const double* W = a.whitening + k * a.E * a.E;
    double of_position = 0.0, of_orientation = 0.0, of_scalars = 0.0, log_scale = 0.0;
    for (int i = 0; i < a.E; ++i) {
      double whitened = 0.0;
      for (int j = 0; j <= i; ++j) whitened += W[i * a.E + j] * e[j];
      (i < position ? of_position : i < width ? of_orientation : of_scalars) += whitened * whitened;
      log_scale += std::log(W[i * a.E + i]);
    }
    nearest = std::min(nearest, std::max(of_position / position, of_orientation / 3.0));
    comparison.log_likelihoods[k] = log_scale - 0.5 * (of_position + of_orientation + of_scalars);
  }
  comparison.coverage_distance = std::sqrt(nearest);
  return comparison;
}

// Writes the sum of a belief (L, K) over ages.
Vector sum_over_ages(const Assistance& a, const double* belief) {
  Vector sum = Vector::Zero(a.K);
  for (int d = 0; d < a.L; ++d, belief += a.K)
    for (int k = 0; k < a.K; ++k) sum[k] += belief[k];
  return sum;
}

// Replaces the belief (L, K) by that one step later, before the next command. Rows move from last to first.
void predict_belief(const Assistance& a, double* belief) {
  Vector leaving = Vector::Zero(a.K);
  const double kept = 1.0 - a.reset;
  for (int d = a.L - 1; d >= 0; --d) {
    const double* hazard = a.hazards + d * a.K;
    double* now = belief + d * a.K;
    double* later = now + a.K;
    for (int k = 0; k < a.K; ++k) {
      const double ends = hazard[k] * now[k], stays = kept * (now[k] - ends);
      leaving[k] += ends;
      if (d == a.L - 1)
        now[k] = stays;  // the last age stands for all longer ones
      else if (d == a.L - 2)
        later[k] += stays;
      else
        later[k] = stays;
    }
  }
  const Vector begins = MatrixView(a.transitions, a.K, a.K).transpose() * leaving;
  for (int k = 0; k < a.K; ++k)
    belief[k] = kept * begins[k] + a.reset / a.K + (a.L == 1 ? belief[k] : 0.0);
}

// Replaces the belief (L, K) by that given a command.
void observe_command(const Assistance& a, const Vector& log_likelihoods, double* belief) {
  const Vector occupied = sum_over_ages(a, belief);
  const Vector log_posterior = occupied.array().log().matrix() + log_likelihoods;
  Vector scale = (log_posterior.array() - log_posterior.maxCoeff()).exp();
  scale /= scale.sum();
  for (int k = 0; k < a.K; ++k) scale[k] = occupied[k] > 0.0 ? scale[k] / occupied[k] : 0.0;
  for (int d = 0; d < a.L; ++d, belief += a.K)
    for (int k = 0; k < a.K; ++k) belief[k] *= scale[k];
}

void advance_filter(const Assistance& a, const Vector& log_likelihoods, AssistanceResult& result) {
  const bool is_first = std::isinf(a.elapsed);
  const double elapsed = a.elapsed + a.dt;
  if (!is_observation_due(a)) {
    result.elapsed = elapsed;
    return;
  }
  const double steps = is_first ? 0.0 : std::floor(std::min(elapsed / a.period + ROUNDING, MAX_STEPS));
  for (int step = 0; step < int(steps); ++step) predict_belief(a, result.belief);
  observe_command(a, log_likelihoods, result.belief);
  const Vector now = sum_over_ages(a, result.belief);
  std::copy_n(is_first ? now.data() : a.now, a.K, result.before);
  std::copy_n(now.data(), a.K, result.now);
  result.elapsed = is_first ? 0.0 : std::max(0.0, elapsed - steps * a.period);
}

double gate_authority(const Assistance& a, double distance) {
  if (!(distance < a.none)) return 0.0;
  const double s = std::min((a.none - distance) / (a.none - a.full), 1.0);
  return s * s * (3.0 - 2.0 * s);
}

// Sets the authority after the step, and whether the operator has left what the skill covers: then it stays at
// zero down to the distance `full`, or until mode or skill change.
void advance_authority(const Assistance& a, double distance, AssistanceResult& result) {
  const bool is_gated = a.mode == SHARED && a.is_current;
  result.has_left = a.has_left && !a.has_changed && !(is_gated && distance <= a.full);
  const double allowed = is_gated && !result.has_left ? gate_authority(a, distance) : 0.0;
  result.authority =
      a.authority + std::min(std::max(allowed - a.authority, -MAX_RATE * a.dt), MAX_RATE * a.dt);
  if (is_gated && !a.has_changed && a.authority > 0.0 && result.authority <= 0.0) result.has_left = true;
}

// Writes the weighted mean of points (K, D), and their deviations from it.
void mix_points(const Assistance& a, const Matrix& points, const Vector& probabilities, double* mean,
                Matrix& deviations) {
  Eigen::Index k;
  probabilities.maxCoeff(&k);
  std::copy_n(points.row(k).data(), a.D, mean);
  const int steps = a.is_oriented() ? 2 : 1;
  for (int step = 0; step <= steps; ++step) {
    for (int n = 0; n < a.K; ++n) deviation(a.manifold, mean, points.row(n).data(), deviations.row(n).data());
    if (step == steps) return;
    const Vector change = deviations.transpose() * probabilities;
    displace(a.manifold, mean, change.data(), mean);
  }
}

// Writes the mean (D) and covariance (E, E) of the carried and fused command; `deviations` are overwritten.
void correct_command(const Assistance& a, Matrix& deviations, const Vector& probabilities, double* corrected,
                     Matrix& covariance) {
  Matrix points(a.K, a.D);
  covariance.setZero(a.E, a.E);
  for (int k = 0; k < a.K; ++k) {
    Vector step = Eigen::Map<const Vector>(a.offsets + k * a.E, a.E);
    step.noalias() += MatrixView(a.gains + k * a.E * a.E, a.E, a.E) * deviations.row(k).transpose();
    displace(a.manifold, a.actual_means + k * a.D, step.data(), points.row(k).data());
    covariance += probabilities[k] * MatrixView(a.fused_covariances + k * a.E * a.E, a.E, a.E);
  }
  mix_points(a, points, probabilities, corrected, deviations);
  covariance.noalias() += (deviations.array().colwise() * probabilities.array()).matrix().transpose() * deviations;
}

// Writes the desired pose (D) of direct or shared control and its covariance.
void operated_pose(const Assistance& a, Comparison& comparison, const Vector& probabilities,
                   AssistanceResult& result, double* desired) {
  const double* x = result.command;
  Eigen::Map<Matrix> covariance(result.covariance, a.E, a.E);
  covariance = Eigen::Map<const Vector>(a.variances, a.E).asDiagonal();
  std::copy_n(x, a.D, desired);
  if (a.mode == SHARED) {
    std::vector<double> corrected(a.D), step(a.E);
    Matrix spread;
    if (a.given_pose) {
      std::copy_n(a.given_pose, a.D, corrected.data());
      spread = MatrixView(a.given_covariance, a.E, a.E);
    } else {
      correct_command(a, comparison.deviations, probabilities, corrected.data(), spread);
    }
    deviation(a.manifold, x, corrected.data(), step.data());
    for (double& value : step) value *= result.authority;
    displace(a.manifold, x, step.data(), desired);
    covariance = result.authority * spread + (1.0 - result.authority) * covariance;
  }
}

// Holds the scalars of a desired pose (D) until what they follow changes or agrees.
void hold_scalars(const Assistance& a, const double* source, AssistanceResult& result, double* desired) {
  for (int s = 0, column = a.scalar_start(); column < a.D; ++s, ++column) {
    const bool is_released = std::abs(source[column] - a.held_values[s]) <= SCALAR_TOLERANCE ||
                             std::abs(source[column] - a.held_commands[s]) > SCALAR_TOLERANCE;
    const double held = is_released ? std::numeric_limits<double>::quiet_NaN() : a.held_values[s];
    result.held_values[s] = held;
    desired[column] = std::isnan(held) ? source[column] : held;
  }
}

// Sets the transition to a desired pose. A new one begins at the target, however far it was behind.
void set_transition(Assistance& a, const double* desired, AssistanceResult& result) {
  std::copy_n(a.offset, a.E, result.offset);
  result.blend_time = a.blend_time + a.dt;
  result.blend_duration = a.blend_duration;
  if (!a.has_changed && result.is_following == a.is_following) return;
  a.desired = a.pose;
  deviation(a.manifold, desired, a.pose, result.offset);
  std::fill(result.offset + a.E - a.scalars(), result.offset + a.E, 0.0);
  result.blend_time = 0.0;
  result.blend_duration = blend_duration(a, result.offset);
}

}  // namespace

bool is_observation_due(const Assistance& a) {
  return a.mode != AUTONOMOUS && !(a.elapsed + a.dt < (1.0 - ROUNDING) * a.period);
}

void assistance_step(Assistance a, AssistanceResult& result) {
  result.is_following = a.is_closed && is_valid_hand(a);
  if (result.is_following)
    map_hand(a, result.command);
  else
    std::copy_n(a.command, a.D, result.command);
  if (is_observation_due(a)) std::copy_n(a.belief, a.L * a.K, result.belief);
  std::copy_n(a.before, a.K, result.before);
  std::copy_n(a.now, a.K, result.now);
  result.elapsed = a.elapsed;
  Comparison comparison = compare(a, result.command);
  if (result.is_following && a.mode != AUTONOMOUS) advance_filter(a, comparison.log_likelihoods, result);
  const double s = std::min(1.0, (result.elapsed + a.dt) / a.period);
  const Vector probabilities = (1.0 - s) * Eigen::Map<const Vector>(result.before, a.K) +
                               s * Eigen::Map<const Vector>(result.now, a.K);
  std::copy_n(probabilities.data(), a.K, result.probabilities);
  advance_authority(a, comparison.coverage_distance, result);
  std::vector<double> desired(a.D), blended(a.D);
  if (a.mode == AUTONOMOUS) {
    std::copy_n(a.given_pose, a.D, desired.data());
    std::copy_n(a.given_covariance, a.E * a.E, result.covariance);
  } else {
    operated_pose(a, comparison, probabilities, result, desired.data());
  }
  hold_scalars(a, a.mode == AUTONOMOUS ? a.given_pose : result.command, result, desired.data());
  set_transition(a, desired.data(), result);
  blend(a, result, desired.data(), blended.data());
  follow_desired(a, blended.data(), result);
}

}  // namespace pilotfish
