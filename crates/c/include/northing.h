/* Northing: attitude, position and velocity from noisy sensors, each with a covariance that is tested for consistency.
 *
 * Link libnorthing_c.a and, on hosts, -lm. Stamps are nanoseconds of one clock, in order. A filter is a structure of yours: nothing
 * is allocated, nothing is freed; an assignment copies and saves it. Every pointer may be null (settings: none are set), and a structure
 * of zeros holds no filter. Define NORTHING_FLOAT where the library was built for single precision: its functions that make filters have
 * other names, so that nothing links otherwise. */

#ifndef NORTHING_H
#define NORTHING_H

/* Made of the library's source: NORTHING_BLESS=1 cargo test -p northing-c writes it anew. */

#include <stdint.h>
#include <stddef.h>

/* The numbers. */
#ifdef NORTHING_FLOAT
typedef float northing_real;
#define northing_mekf_init northing_mekf_init_float
#define northing_bounded_velocity_init northing_bounded_velocity_init_float
#define northing_gnss_ins_init northing_gnss_ins_init_float
#else
typedef double northing_real;
#define NORTHING_DOUBLE
#endif

#if defined(NORTHING_DOUBLE)
// Words of the memory of each filter.
#define NORTHING_MEKF_WORDS 1140
#endif

#if !defined(NORTHING_DOUBLE)
// Words of the memory of each filter.
#define NORTHING_MEKF_WORDS 620
#endif

#if defined(NORTHING_DOUBLE)
// Words of the memory of each filter.
#define NORTHING_BOUNDED_VELOCITY_WORDS 2040
#endif

#if !defined(NORTHING_DOUBLE)
// Words of the memory of each filter.
#define NORTHING_BOUNDED_VELOCITY_WORDS 1080
#endif

#if defined(NORTHING_DOUBLE)
// Words of its memory.
#define NORTHING_GNSS_INS_WORDS 8300
#endif

#if !defined(NORTHING_DOUBLE)
// Words of its memory.
#define NORTHING_GNSS_INS_WORDS 4250
#endif

// How a call ended.
typedef enum {
  // It did what it says.
  NORTHING_STATUS_OK = 0,
  // A pointer is null, or the structure holds no filter: it was not initialised.
  NORTHING_STATUS_NO_FILTER = 1,
  // There is no parameter of this name.
  NORTHING_STATUS_UNKNOWN_PARAMETER = 2,
  // A parameter outside its permitted range, or of another kind.
  NORTHING_STATUS_OUT_OF_RANGE = 3,
  // There is no estimate yet: the filter aligns itself.
  NORTHING_STATUS_ALIGNING = 4,
  // The sample was refused and has changed nothing: not finite, not newer, out of range.
  NORTHING_STATUS_SKIPPED = 5,
  // The filter makes no statement of that kind.
  NORTHING_STATUS_NOT_STATED = 6,
} northing_status;

// What a filter did with a measurement.
typedef enum {
  // Used with its stated noise.
  NORTHING_OUTCOME_FUSED = 0,
  // Used with inflated noise.
  NORTHING_OUTCOME_INFLATED = 1,
  // Refused: too far from what was expected.
  NORTHING_OUTCOME_GATED = 2,
  // Not used: not finite, out of range (so is a standard deviation of 0), not newer, the same numbers again, far from its neighbours,
  // or there is no filter, or it is not aligned yet.
  NORTHING_OUTCOME_NOT_USED = 3,
  // Taken: it takes effect with a later sample, and is in that innovation.
  NORTHING_OUTCOME_GATHERED = 4,
} northing_outcome;

// What the position is worth.
typedef enum {
  // There is no position yet.
  NORTHING_SOLUTION_STATUS_ALIGNING = 0,
  // Fixes come, position and velocity are good; the heading is not known yet.
  NORTHING_SOLUTION_STATUS_HEADING_UNKNOWN = 1,
  // Fixes come.
  NORTHING_SOLUTION_STATUS_AIDED = 2,
  // No fix for a while.
  NORTHING_SOLUTION_STATUS_DEAD_RECKONING = 3,
  // No fix for too long, or too uncertain.
  NORTHING_SOLUTION_STATUS_INVALID = 4,
} northing_solution_status;

// What the parameters start from. Functions take it as a number: one that is none of these is refused as out of range.
typedef enum {
  // Carried by people.
  NORTHING_PROFILE_HAND_HELD = 0,
  // On a bench.
  NORTHING_PROFILE_LAB = 1,
} northing_profile;

// The multiplicative extended Kalman filter: attitude and gyroscope bias. Yours to keep; copy it by assignment.
typedef struct {
  // Its memory; nobody else's business.
  uint64_t words[NORTHING_MEKF_WORDS];
} northing_mekf;

// A parameter by the name that `northing estimators NAME` lists, without the estimator's prefix, and its value.
typedef struct {
  // Its name.
  const char *name;
  // Its value: a number in the first place, a switch as 0 or 1 there, or the three components of a vector.
  northing_real value[3];
} northing_setting;

// What a measurement told a filter.
typedef struct {
  // Measured less predicted, in the unit of the sensor.
  northing_real residual[3];
  // What the filter expected of it, S, row by row.
  northing_real covariance[9];
  // Normalised innovation squared.
  northing_real nis;
  // Components measured; 0 where nothing was.
  uint8_t degrees_of_freedom;
  // What was done with it.
  northing_outcome outcome;
} northing_innovation;

// The bounded-velocity filter: for phones and wearables. Yours to keep; copy it by assignment.
typedef struct {
  // Its memory; nobody else's business.
  uint64_t words[NORTHING_BOUNDED_VELOCITY_WORDS];
} northing_bounded_velocity;

// The GNSS/INS. Yours to keep; copy it by assignment.
typedef struct {
  // Its memory; nobody else's business.
  uint64_t words[NORTHING_GNSS_INS_WORDS];
} northing_gnss_ins;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

#if defined(NORTHING_DOUBLE)
// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
//
// # Safety
// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
northing_status northing_mekf_init(northing_mekf *filter, int profile, const northing_setting *settings, size_t count);
#endif

#if !defined(NORTHING_DOUBLE)
// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
//
// # Safety
// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
northing_status northing_mekf_init_float(northing_mekf *filter,
                                         int profile,
                                         const northing_setting *settings,
                                         size_t count);
#endif

// Takes an angular rate, rad/s, body axes.
//
// # Safety
// `filter` is null or points to a structure; `rate` is null or points to three numbers.
northing_status northing_mekf_gyroscope(northing_mekf *filter, int64_t time_ns, const northing_real *rate);

// Takes a specific force, m/s^2, body axes: at rest +9.81 on the axis that points up. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure; `force` is null or points to three numbers.
northing_innovation northing_mekf_accelerometer(northing_mekf *filter, int64_t time_ns, const northing_real *force);

// Takes a magnetic field, microtesla, body axes. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure; `field` is null or points to three numbers.
northing_innovation northing_mekf_magnetometer(northing_mekf *filter, int64_t time_ns, const northing_real *field);

// Writes the attitude, body to east-north-up, w, x, y, z.
//
// # Safety
// `filter` is null or points to a structure; `to` is null or points to four numbers.
northing_status northing_mekf_quat(const northing_mekf *filter, northing_real *to);

// Writes the covariance of the local attitude error in body axes, rad^2, row by row.
//
// # Safety
// `filter` is null or points to a structure; `to` is null or points to nine numbers.
northing_status northing_mekf_covariance(const northing_mekf *filter, northing_real *to);

// Writes the gyroscope bias, rad/s.
//
// # Safety
// `filter` is null or points to a structure; `to` is null or points to three numbers.
northing_status northing_mekf_gyroscope_bias(const northing_mekf *filter, northing_real *to);

#if defined(NORTHING_DOUBLE)
// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
//
// # Safety
// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
northing_status northing_bounded_velocity_init(northing_bounded_velocity *filter,
                                               int profile,
                                               const northing_setting *settings,
                                               size_t count);
#endif

#if !defined(NORTHING_DOUBLE)
// Makes a filter that waits for its first samples, with a profile and parameters by name. On an error nothing is made.
//
// # Safety
// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
northing_status northing_bounded_velocity_init_float(northing_bounded_velocity *filter,
                                                     int profile,
                                                     const northing_setting *settings,
                                                     size_t count);
#endif

// Takes an angular rate, rad/s, body axes.
//
// # Safety
// `filter` is null or points to a structure; `rate` is null or points to three numbers.
northing_status northing_bounded_velocity_gyroscope(northing_bounded_velocity *filter,
                                                    int64_t time_ns,
                                                    const northing_real *rate);

// Takes a specific force, m/s^2, body axes: at rest +9.81 on the axis that points up. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure; `force` is null or points to three numbers.
northing_innovation northing_bounded_velocity_accelerometer(northing_bounded_velocity *filter,
                                                            int64_t time_ns,
                                                            const northing_real *force);

// Takes a magnetic field, microtesla, body axes. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure; `field` is null or points to three numbers.
northing_innovation northing_bounded_velocity_magnetometer(northing_bounded_velocity *filter,
                                                           int64_t time_ns,
                                                           const northing_real *field);

// Writes the attitude, body to east-north-up, w, x, y, z.
//
// # Safety
// `filter` is null or points to a structure; `to` is null or points to four numbers.
northing_status northing_bounded_velocity_quat(const northing_bounded_velocity *filter, northing_real *to);

// Writes the covariance of the local attitude error in body axes, rad^2, row by row.
//
// # Safety
// `filter` is null or points to a structure; `to` is null or points to nine numbers.
northing_status northing_bounded_velocity_covariance(const northing_bounded_velocity *filter, northing_real *to);

// Writes the gyroscope bias, rad/s.
//
// # Safety
// `filter` is null or points to a structure; `to` is null or points to three numbers.
northing_status northing_bounded_velocity_gyroscope_bias(const northing_bounded_velocity *filter, northing_real *to);

#if defined(NORTHING_DOUBLE)
// Makes a GNSS/INS that waits for its first samples, with parameters by name. On an error nothing is made.
//
// # Safety
// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
northing_status northing_gnss_ins_init(northing_gnss_ins *filter, const northing_setting *settings, size_t count);
#endif

#if !defined(NORTHING_DOUBLE)
// Makes a GNSS/INS that waits for its first samples, with parameters by name. On an error nothing is made.
//
// # Safety
// `filter` is null or points to a structure; `settings` is null or points to `count` settings with names.
northing_status northing_gnss_ins_init_float(northing_gnss_ins *filter, const northing_setting *settings, size_t count);
#endif

// Takes an angular rate, rad/s, and a specific force, m/s^2, of one stamp.
//
// # Safety
// `filter` is null or points to a structure; the others are null or point to three numbers.
northing_status northing_gnss_ins_imu(northing_gnss_ins *filter,
                                      int64_t time_ns,
                                      const northing_real *rate,
                                      const northing_real *force);

// Takes a position, m north, east, down of the origin, with its standard deviations, above 0. Without a height down is NaN. Tells what
// it told horizontally; what it told vertically is written to `vertical`, unless that is null.
//
// # Safety
// `filter` is null or points to a structure; `ned` and `std` are null or point to three numbers, `vertical` to a structure.
northing_innovation northing_gnss_ins_position(northing_gnss_ins *filter,
                                               int64_t time_ns,
                                               const northing_real *ned,
                                               const northing_real *std,
                                               northing_innovation *vertical);

// Takes a velocity over ground, m/s north, east, down, with its standard deviations, above 0. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure; the others are null or point to three numbers.
northing_innovation northing_gnss_ins_velocity(northing_gnss_ins *filter,
                                               int64_t time_ns,
                                               const northing_real *ned,
                                               const northing_real *std);

// Takes a true heading of the forward axis, rad clockwise from north, with its standard deviation. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure.
northing_innovation northing_gnss_ins_heading(northing_gnss_ins *filter,
                                              int64_t time_ns,
                                              northing_real heading,
                                              northing_real std);

// Takes a magnetic field, microtesla, body axes. Tells what it told.
//
// # Safety
// `filter` is null or points to a structure; `field` is null or points to three numbers.
northing_innovation northing_gnss_ins_magnetometer(northing_gnss_ins *filter,
                                                   int64_t time_ns,
                                                   const northing_real *field);

// What the position is worth; of a structure without a filter: aligning.
//
// # Safety
// `filter` is null or points to a structure.
northing_solution_status northing_gnss_ins_solution_status(const northing_gnss_ins *filter);

// Writes position (m) and velocity (m/s), north, east, down, and their standard deviations; each may be null.
//
// # Safety
// `filter` is null or points to a structure; the others are null or point to three numbers.
northing_status northing_gnss_ins_solution(const northing_gnss_ins *filter,
                                           northing_real *position,
                                           northing_real *position_std,
                                           northing_real *velocity,
                                           northing_real *velocity_std);

// Writes the attitude, body to north-east-down, w, x, y, z.
//
// # Safety
// `filter` is null or points to a structure; `quat` is null or points to four numbers.
northing_status northing_gnss_ins_quat(const northing_gnss_ins *filter, northing_real *quat);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* NORTHING_H */
