/* Fields: what fills space and time around a vehicle. Gravity, the magnetic field, air and wind, light, where celestial bodies are, what
 * time it is: one table, and a quantity that fixes what it gives. A field is a function of place and time and of nothing else: what
 * depends on how something moves through it is the business of the device that reads it.
 *
 * Points and values are in world axes, SI. Functions marked [step: pure] depend on their arguments only, give the same bits each time,
 * and run on any thread. */
#ifndef CARDAN_FIELD_H
#define CARDAN_FIELD_H
#include "cardan_abi.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CARDAN_KIND_FIELD "field" /* since 2.1 */

/* What a field gives at a point, n numbers. */
enum cardan_quantity {
  CARDAN_GRAVITY = 0,  /* 4: acceleration a of what falls there [m/s^2]; potential U [m^2/s^2], 0 without CARDAN_FIELD_POTENTIAL */
  CARDAN_MAGNETIC = 1, /* 3: flux density [T]. Without sources: div B = 0 */
  CARDAN_DENSITY = 2,  /* 1: of the air [kg/m^3], >= 0 */
  CARDAN_WIND = 3,     /* 3: velocity of the air [m/s] */
  CARDAN_LIGHT = 4,    /* 3: irradiance, along the direction in which the light goes [W/m^2] */
  CARDAN_POSITION = 5, /* 3: of a celestial body [m]. Of time alone */
  CARDAN_ATTITUDE = 6, /* 4: of a celestial body, unit quaternion w, x, y, z from its axes to world axes. Of time alone */
  CARDAN_TIME = 7      /* 1: seconds since 2000 January 1, 12 h TT [s]. Of time alone */
};
enum { CARDAN_FIELD_NUMBERS = 4, CARDAN_FIELD_EDGES = 4 }; /* at most */

/* Facts, each proven by laws when the field is loaded. */
enum cardan_field_fact {
  CARDAN_FIELD_GRADIENT = 1u,    /* evaluate fills gradients; else the host takes differences */
  CARDAN_FIELD_POTENTIAL = 2u,   /* of gravity: a = -grad U, so curl a = 0 */
  CARDAN_FIELD_STEADY = 4u,      /* does not depend on time: with a potential, the ledger has the energy of bodies in it */
  CARDAN_FIELD_SOURCE_FREE = 8u, /* of a vector: its divergence is 0 (gravity: outside of masses) */
  CARDAN_FIELD_CURL_FREE = 16u   /* of a vector: its curl is 0 (magnetic: outside of currents) */
};

/* An end of what a field knows: an altitude, an epoch. Beyond it a field that can hold gives what it has at the end, and goes on only if
 * the vehicle file says so (outside: hold); else the step is refused. */
typedef struct cardan_limit_desc {
  const char* name;
  uint32_t holds; /* 1: evaluate gives the value of the end beyond it */
  const char* meaning;
} cardan_limit_desc;

/* prepared: what `prepare` made of t; null without it. */
typedef struct cardan_field_args {
  uint32_t struct_size;
  double t; /* [s] of the run */
  const void* packed;
  const void* prepared;
} cardan_field_args;

typedef struct cardan_field_family {
  uint32_t struct_size;
  const char *type, *summary;
  uint32_t quantity; /* cardan_quantity */
  uint32_t facts;
  double distance; /* [m] from the origin of the world: at about that distance, and at parameters of order one, the laws try it; 0: 1 m */
  uint32_t params_size; /* bytes of the packed parameters, trivially copyable, align 8; see packed_size */
  const cardan_param_desc* params;
  uint32_t n_params, param_size; /* how many, and sizeof(cardan_param_desc): from one to the next; so for limits */
  const cardan_limit_desc* limits;
  uint32_t n_limits, limit_size;                         /* at most 31 */
  int (*pack)(const cardan_param_values*, void* packed); /* [setup] 0 = done; null: no parameters */
  /* [step: pure] At n points (3 numbers each): values (n times those of the quantity), and unless it is null gradients (9 n, or 12 n, 3 n,
   * ...: for each value its derivatives along x, y, z). Point by point the same as all at once. 0, or of the limits that a point is
   * beyond: bit i. Of what is of time alone n is 1, points are not read, gradients null. */
  int (*evaluate)(const cardan_field_args*, uint32_t n, const double* points, double* values, double* gradients);
  /* The rest may be beyond struct_size. [step: pure] (optional) Once for each time, before evaluate: what depends on time alone, into
   * prepared_size bytes (align 8). 0, or bits of limits as evaluate. */
  uint32_t prepared_size;
  int (*prepare)(double t, const void* packed, void* prepared);
  uint64_t (*packed_size)(const cardan_param_values*); /* [setup] (optional) bytes of this instance, in place of params_size */
  /* Since 2.6. [step: pure] (optional) Functions of place and time that change their sign where values have a corner, and are smooth and
   * far from flat on both sides of it, so that a step can end there: the edges of a shadow. How many there are, a fact of the parameters
   * and at most CARDAN_FIELD_EDGES; unless g is null, their values at one point (3 numbers). Not asked of what is of time alone. */
  uint32_t (*edges)(const cardan_field_args*, const double* point, double* g);
} cardan_field_family;

#ifdef __cplusplus
}
#endif
#endif
