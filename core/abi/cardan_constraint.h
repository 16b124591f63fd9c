/* Constraints: what closes loops. DECLARED, NOT HONOURED: the kind has its name and the form below so that plugins and hosts agree on what
 * will come, and a host of this version refuses a plugin that brings one (C0605). The header may change until a host honours it.
 *
 * A constraint has rows phi_i(q, t) = 0 between mounts (nodes and hinge components, as those of devices). It gives the residual, the
 * directions in which its multipliers push, and the part of phi'' that does not come from v'. Multipliers act with J* on the mounts: no
 * constraint does work but by the explicit dependence of phi on t. */
#ifndef CARDAN_CONSTRAINT_H
#define CARDAN_CONSTRAINT_H
#include "core/abi/cardan_device.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CARDAN_KIND_CONSTRAINT "constraint.draft0"

enum cardan_constraint_fact {
  CARDAN_CONSTRAINT_STEADY = 1u,    /* phi does not depend on t: the multipliers do no work */
  CARDAN_CONSTRAINT_INTERNAL = 2u,  /* the loads of each row on nodes sum to zero: momentum of the whole stays */
  CARDAN_CONSTRAINT_ONE_SIDED = 4u, /* phi >= 0, multipliers >= 0, one of them 0 */
  CARDAN_CONSTRAINT_RATES = 8u      /* rows are of velocities alone (rolling): phi is J v + the part of t */
};

typedef struct cardan_row_desc {
  const char* name;
  const char* unit; /* of phi */
  double nominal;   /* > 0: its size in use, which its drift is measured by */
  const char* meaning;
} cardan_row_desc;

typedef struct cardan_constraint_args {
  uint32_t struct_size;
  double t;
  const void* packed;
  const cardan_mount_motion* mount;
} cardan_constraint_args;

/* All of it is zero before the call. */
typedef struct cardan_constraint_out {
  double* phi;               /* n_rows */
  double* phidot_t;          /* n_rows: d phi / dt at fixed q */
  cardan_mount_load* column; /* n_rows times n_mounts: the loads that a multiplier of 1 puts on each mount; J* row by row */
  double* bias;              /* n_rows: phi'' where v' = 0 */
} cardan_constraint_out;

typedef struct cardan_constraint_family {
  uint32_t struct_size;
  const char *type, *summary;
  uint32_t facts;
  uint32_t params_size;
  const cardan_param_desc* params;
  uint32_t n_params, param_size;
  const cardan_mount_desc* mounts;
  uint32_t n_mounts, mount_size;
  const cardan_row_desc* rows;
  uint32_t n_rows, row_size;
  int (*pack)(const cardan_param_values*, void* packed);                              /* [setup] */
  int (*evaluate)(const cardan_constraint_args*, cardan_constraint_out*);             /* [step: pure] */
  int (*assemble)(const cardan_constraint_args*, cardan_mount_motion* nearer);        /* [setup] (optional) a step towards phi = 0 */
  void (*roots)(const cardan_constraint_args*, const double* multipliers, double* g); /* [step: pure] ONE_SIDED: where it opens or closes */
} cardan_constraint_family;

#ifdef __cplusplus
}
#endif
#endif
