// One step of direct, carried shared and autonomous control. Defined by kernels/reference/assistance.py.
#pragma once

#include "manifold.hpp"

namespace pilotfish {

enum Mode { DIRECT, SHARED, AUTONOMOUS };

// Arguments as in kernels/assistance_types.py, for K states, D columns, E tangent columns and L ages.
struct Assistance {
  int K, D, E, L;
  Manifold manifold;
  const double *matrix, *shift, *left, *right;  // HandMap
  const double *observed_means, *whitening, *actual_means, *offsets, *gains, *fused_covariances;  // CarriedModel
  const double *transitions, *hazards;                                                            // OccupancyTables
  double reset;
  const double *variances, *lower, *upper;  // AssistanceSettings
  double full, none, speed, acceleration, angular_speed, angular_acceleration, period;
  const double *belief, *before, *now;  // StateFilter
  double elapsed;
  const double *command, *offset, *pose, *velocity, *desired, *held_values, *held_commands;  // AssistanceMemory
  double authority, blend_time, blend_duration;
  bool is_following, has_left;
  const double *hand, *given_pose, *given_covariance;  // AssistanceInput; the last two may be null
  double dt;
  int mode;
  bool is_closed, is_current, has_changed;

  bool is_oriented() const { return D != E; }
  int scalar_start() const { return is_oriented() ? 7 : 3; }
  int scalars() const { return D - scalar_start(); }
};

// What a step writes: AssistanceMemory, covariance and probabilities. The belief (L, K) is written only if the
// step observes the command.
struct AssistanceResult {
  double *belief, *before, *now, *command, *offset, *pose, *velocity, *desired, *held_values, *covariance,
      *probabilities;
  double elapsed, authority, blend_time, blend_duration;
  bool is_following, has_left;
};

// Returns whether the filter observes the command of this step, which is valid or not.
bool is_observation_due(const Assistance& a);

void assistance_step(Assistance a, AssistanceResult& result);

}  // namespace pilotfish
