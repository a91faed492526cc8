#include "target_motion.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace pilotfish {

namespace {

constexpr double BLEND_SPEED = 0.25, BLEND_ANGULAR_SPEED = 1.0;  // m/s, rad/s
constexpr double MIN_BLEND = 0.3;                                // s
constexpr double PEAK = 1.875;
constexpr double TINY = 1e-12;

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double norm(const double* v) { return std::sqrt(dot(v, v)); }
double clip(double value, double low, double high) { return std::min(std::max(value, low), high); }

// Writes the velocity towards `wanted` after a change of at most this norm, braking first.
void accelerate(const double* v, const double* wanted, double change, const double* low, const double* high,
                double* after) {
  double braked[3], braking[3], rest[3], bounded[3];
  for (int i = 0; i < 3; ++i) {
    braked[i] = clip(v[i], low[i], high[i]);
    bounded[i] = clip(wanted[i], low[i], high[i]);
    braking[i] = braked[i] - v[i];
    rest[i] = bounded[i] - braked[i];
  }
  const double squared = dot(rest, rest), product = dot(braking, rest);
  const double left = std::max(0.0, change * change - dot(braking, braking));
  if (squared + 2.0 * product <= left) {
    std::copy_n(bounded, 3, after);
    return;
  }
  const double share = (std::sqrt(product * product + squared * left) - product) / squared;
  for (int i = 0; i < 3; ++i) after[i] = braked[i] + rest[i] * share;
}

// Writes the velocity of three columns towards the desired pose.
void follow_columns(const double* v, const double* change, const double* error, double speed,
                    double acceleration, double dt, const double* low, const double* high, double* after) {
  const double distance = norm(error);
  const double approach = std::min(1.0 / dt, std::sqrt(acceleration / std::max(distance, TINY)));
  double wanted[3];
  for (int i = 0; i < 3; ++i) wanted[i] = change[i] / dt + approach * error[i];
  const double length = norm(wanted);
  if (!(length <= speed))
    for (double& value : wanted) value *= speed / length;
  accelerate(v, wanted, acceleration * dt, low, high, after);
}

}  // namespace

double blend_duration(const Assistance& a, const double* offset) {
  const double angle = a.is_oriented() ? norm(offset + 3) : 0.0;
  return std::max({MIN_BLEND, PEAK * norm(offset) / BLEND_SPEED, PEAK * angle / BLEND_ANGULAR_SPEED});
}

void blend(const Assistance& a, const AssistanceResult& result, const double* desired, double* blended) {
  if (result.blend_time >= result.blend_duration) {
    std::copy_n(desired, a.D, blended);
    return;
  }
  const double s = result.blend_time / result.blend_duration;
  const double remaining = 1.0 - s * s * s * (10.0 - s * (15.0 - 6.0 * s));
  std::vector<double> offset(result.offset, result.offset + a.E);
  for (double& value : offset) value *= remaining;
  displace(a.manifold, desired, offset.data(), blended);
}

void follow_desired(const Assistance& a, const double* desired, AssistanceResult& result) {
  std::copy_n(desired, a.D, result.desired);
  for (int i = 0; i < 3; ++i) result.desired[i] = clip(desired[i], a.lower[i], a.upper[i]);
  std::vector<double> work(3 * a.E, 0.0);
  double *change = work.data(), *error = change + a.E, *step = error + a.E;
  deviation(a.manifold, a.desired, result.desired, change);
  deviation(a.manifold, a.pose, a.desired, error);
  const double b = a.acceleration / std::sqrt(3.0);
  double low[3], high[3];
  for (int i = 0; i < 3; ++i) {  // the speeds at which braking by b still stops at the walls
    const double below = std::max(a.pose[i] - a.lower[i], 0.0), above = std::max(a.upper[i] - a.pose[i], 0.0);
    low[i] = -b * (std::sqrt(a.dt * a.dt + 2.0 * below / b) - a.dt);
    high[i] = b * (std::sqrt(a.dt * a.dt + 2.0 * above / b) - a.dt);
  }
  std::fill_n(result.velocity, a.E, 0.0);
  follow_columns(a.velocity, change, error, a.speed, a.acceleration, a.dt, low, high, result.velocity);
  if (a.is_oriented()) {
    const double none[] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}, all[] = {HUGE_VAL, HUGE_VAL, HUGE_VAL};
    follow_columns(a.velocity + 3, change + 3, error + 3, a.angular_speed, a.angular_acceleration, a.dt, none,
                   all, result.velocity + 3);
  }
  for (int i = 0; i < a.E; ++i) step[i] = result.velocity[i] * a.dt;
  displace(a.manifold, a.pose, step, result.pose);
  for (int i = 0; i < 3; ++i) {
    result.pose[i] = clip(result.pose[i], std::min(a.lower[i], a.pose[i]), std::max(a.upper[i], a.pose[i]));
    result.velocity[i] = (result.pose[i] - a.pose[i]) / a.dt;
  }
  if (a.is_oriented()) {
    double* q = result.pose + 3;
    const double length = std::sqrt(q[0] * q[0] + dot(q + 1, q + 1));
    for (int i = 0; i < 4; ++i) q[i] /= length;
  }
  std::copy(result.desired + a.scalar_start(), result.desired + a.D, result.pose + a.scalar_start());
}

}  // namespace pilotfish
