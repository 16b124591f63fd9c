/* Devices: whatever acts on a vehicle or measures it and is neither a body nor a hinge. Actuators, force elements between nodes or on
 * hinges, sensors, blocks of a controller: one table. What has mass and moves is a body; a device adds forces, signals and states.
 *
 * A device has mounts (nodes and hinge components that it reads and pushes at), ports (numbers that others give it, numbers that it
 * gives), continuous states z that are integrated with those of the vehicle, and marks d, numbers that change at accepted instants
 * alone. Functions marked [step: pure] depend on their arguments only, give the same bits each time, and run on any thread: a step that
 * is tried and rejected leaves no trace. SI units; angles in rad. */
#ifndef CARDAN_DEVICE_H
#define CARDAN_DEVICE_H
#include "core/abi/cardan_abi.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CARDAN_KIND_DEVICE "device" /* since 2.1 */

/* What a device is for: told to people, and when it ticks. */
enum cardan_device_role {
  CARDAN_ROLE_BY_PORTS = 0,  /* with a sampled part: a sensor without inputs, else a controller */
  CARDAN_ROLE_FORCE = 1,     /* force element */
  CARDAN_ROLE_ACTUATOR = 2,  /* ticks after controllers and scripts */
  CARDAN_ROLE_SENSOR = 3,    /* ticks before them, with inputs as well */
  CARDAN_ROLE_CONTROLLER = 4 /* ticks after scripts, as actuators do */
};

enum cardan_mount_kind {
  CARDAN_MOUNT_NODE = 0, /* a node of a body, or its origin; of an internal device that reads poses and velocities alone, also the ground */
  CARDAN_MOUNT_HINGE = 1, /* one velocity component of a hinge, with its coordinate where it has one */
  CARDAN_MOUNT_MASS = 2,  /* a rigid body that carries what `mass` tells, beside its own mass: read and pushed as the node at its origin.
                             At most one */
  CARDAN_MOUNT_FIELD = 3  /* a field, at the nearest node before it in the list, whose CARDAN_USE_POSE is then implied */
};

/* What a device does at a node. What nobody reads is not computed. At a hinge all of it is there at no cost. */
enum cardan_mount_use {
  CARDAN_USE_POSE = 1u,         /* reads R_WN and position */
  CARDAN_USE_VELOCITY = 2u,     /* reads omega and velocity */
  CARDAN_USE_LOAD = 4u,         /* pushes: moment and force, or tau */
  CARDAN_USE_ACCELERATION = 8u, /* reads alpha and specific_force; all that the mount reads is then read by `tick` and `follow` alone */
  CARDAN_USE_OUTLET = 16u,      /* what is drawn from a device with a mass leaves the vehicle here: at one node at most */
  CARDAN_USE_HOLD = 32u,        /* a hinge component that stands still while the first mark is not 0: at one at most; see `holds` */
  CARDAN_USE_OPTIONAL = 64u,    /* of a field: the scene may have none, all its numbers are then 0 */
  CARDAN_USE_IMPULSE = 128u,    /* since 2.2: pushes all at once, out of `impulse` alone, and costs nothing in a step */
  CARDAN_USE_TURN = 256u,       /* since 2.5: of a hinge component: one that turns; another is refused */
  CARDAN_USE_COORDINATE = 512u  /* since 2.5: of a hinge component: one with a coordinate of its own; another is refused */
};

typedef struct cardan_mount_desc {
  const char* name; /* the key of the vehicle file: "at", "from", "to" */
  uint32_t kind;    /* cardan_mount_kind */
  uint32_t use;     /* cardan_mount_use, or-ed. Of a field its quantity (cardan_field.h), and perhaps CARDAN_USE_OPTIONAL */
  const char* meaning;
} cardan_mount_desc;

/* A number that a device is given or gives. Side by side, with one unit and frame, NAME_x, NAME_y, NAME_z or NAME_1 to NAME_n are the
 * vector NAME: connected, commanded and read as one. */
enum cardan_port_kind { CARDAN_PORT_IN = 0, CARDAN_PORT_OUT = 1 };
typedef struct cardan_port_desc {
  const char* name;
  uint32_t kind; /* cardan_port_kind */
  const char* unit;
  double fallback; /* IN: what it is until it is given something else */
  uint64_t direct; /* OUT: bit i: depends on input i (among the inputs) in the same evaluation */
  const char* meaning;
  const char* frame; /* the mount at a node in whose axes it is a component, or null: it has none. Ends of a connection that have one have
                        the same */
  uint32_t flags;    /* cardan_port_flag, or-ed */
  const char* valid; /* since 2.2. Another port of that kind, of unit 1, that says whether this number holds: 1, or 0. Of an OUT it is given
                        in the same evaluation; an IN takes with a connection what says it of the output, its fallback is 1. Null: it
                        always does; of an IN: nobody asks, and `check` says so where an output may be invalid */
} cardan_port_desc;
#define CARDAN_CAUSE_TICK 0xffffffffu
enum cardan_port_flag {
  CARDAN_PORT_REQUIRED = 1u /* IN: the vehicle file gives it a number or a connection: there is no sensible fallback */
};

/* A continuous state, or a mark. */
typedef struct cardan_state_desc {
  const char* name;
  const char* unit;
  double initial;
  double nominal; /* > 0: its size in use, which its error is measured by. Of marks not read */
  const char* meaning;
} cardan_state_desc;

/* How a mount moves. Of a hinge component q, v and vdot alone; q is 0 where it has no coordinate of its own. Of a field `field` alone. Of
 * CARDAN_FACT_INTERNAL position and velocity may be counted from any point that moves evenly, one for all nodes of the device. */
typedef struct cardan_mount_motion {
  double R_WN[9];                     /* node axes to world axes, row-major */
  double position[3];                 /* [m] world axes */
  double omega[3];                    /* [rad/s] node axes */
  double velocity[3];                 /* [m/s] node axes */
  double q, v;                        /* [rad, m], [rad/s, m/s] */
  double alpha[3], specific_force[3]; /* [rad/s^2], [m/s^2] acceleration less gravity there; node axes. In `tick` and `follow`, else 0 */
  double vdot;                        /* [rad/s^2, m/s^2] of a hinge component. In `tick` and `follow`, else 0 */
  double field[8];                    /* the numbers of its quantity. Gravity, magnetic field, wind, light: in the axes of the node */
} cardan_mount_motion;

typedef struct cardan_mount_load {
  double moment[3], force[3]; /* [N m], [N] on the node, node axes */
  double tau;                 /* [N m, N] on the hinge component, dual to v */
} cardan_mount_load;

/* What a body carries beside its own mass. The host puts it into all that has the mass of the body, and gives the forces of what flows:
 * docs/mathematics/devices.md, 5. */
typedef struct cardan_mass {
  double mass;       /* [kg] */
  double centre[3];  /* [m] mass centre from the origin of the body, its axes */
  double inertia[6]; /* [kg m^2] tensor about the mass centre, axes of the body: xx yy zz xy xz yz */
} cardan_mass;

/* Pointers in the order of the descriptions; null where there are none. */
typedef struct cardan_device_args {
  uint32_t struct_size;
  double t; /* [s] */
  const void* packed;
  const double* in;
  const cardan_mount_motion* mount;
  const double* z;
  const double* d;
} cardan_device_args;

/* All of it is zero before the call. */
typedef struct cardan_device_out {
  double* zdot;
  double* out;
  cardan_mount_load* load;
  double delivered, lost; /* [W] brought in from a supply that is no part of the model; turned to heat. CARDAN_FACT_ENERGY only */
} cardan_device_out;

/* Facts, each proven by laws when the device is loaded. */
enum cardan_device_fact {
  CARDAN_FACT_INTERNAL = 1u, /* forces and moments of its nodes sum to zero: momentum of the whole stays. Where it reads no other node and
                                no field, they follow from where its nodes are, and how they move, as seen from each other */
  CARDAN_FACT_ENERGY = 2u,   /* `energy`, `delivered` and `lost` are given: energy' = delivered - lost - power of its loads. It reads
                                the velocity of every node that it pushes at */
  CARDAN_FACT_PASSIVE = 4u,  /* lost >= 0 at every evaluation, and delivered = 0 */
  CARDAN_FACT_ROUGH = 8u     /* has layers that are thin beside a step: the integrals of the ledger take more points */
};

typedef struct cardan_device_family {
  uint32_t struct_size;
  const char *type, *summary;
  uint32_t facts;
  uint32_t params_size; /* bytes of the packed parameters, trivially copyable, align 8; see packed_size */
  const cardan_param_desc* params;
  uint32_t n_params, param_size; /* how many, and sizeof(cardan_param_desc): from one to the next; so for all lists */
  const cardan_mount_desc* mounts;
  uint32_t n_mounts, mount_size;
  const cardan_port_desc* ports;
  uint32_t n_ports, port_size;
  const cardan_state_desc* states; /* z */
  uint32_t n_states, state_size;
  const cardan_state_desc* marks; /* d */
  uint32_t n_marks, mark_size;
  uint32_t n_roots;
  int (*pack)(const cardan_param_values*, void* packed); /* [setup] 0 = done; null: no parameters */
  /* [step: pure] Loads, outputs and z' before v' is known: nothing in a device depends on an acceleration. 0 = done, else the step is
   * tried again smaller. */
  int (*evaluate)(const cardan_device_args*, cardan_device_out*);
  /* The rest may be beyond struct_size. [setup] (optional) Sizes in use of the states where they follow from the parameters; they are those
   * of the descriptions before. */
  void (*nominal)(const void* packed, double* sizes);
  /* [step: pure] (optional) Derivative of evaluate along a direction: in, mount, z of `along` are rates of change (R_WN too, t is not
   * read). Null: by differences. */
  int (*tangent)(const cardan_device_args*, const cardan_device_args* along, cardan_device_out*);
  double (*energy)(const cardan_device_args*); /* [step: pure] [J] stored. CARDAN_FACT_ENERGY only */
  /* [step: pure] (optional) n_roots functions that are zero where evaluate has a corner, or where something happens: located, and the
   * method starts anew there. */
  void (*roots)(const cardan_device_args*, double* g);
  /* [accepted] (optional) At a root that crossed zero (rising: +1, falling: -1), in a step or by a jump of the vehicle, and with root =
   * n_roots at the start and where its parameters change in a run, or a hinge of it is counted from another zero: may change z and d. A
   * root that is exactly zero where a step begins has no side to cross from. */
  void (*event)(const cardan_device_args*, uint32_t root, int direction, double* z, double* d);
  /* [accepted] (optional) At the ticks of a rate that the vehicle gives, the start included: sampled parts. `noise`: n_noise independent
   * numbers of mean 0 and variance 1, a function of the seed, the name of the device and the tick. May change z and d. 0 = done. */
  int (*tick)(const cardan_device_args*, double period, const double* noise, double* z, double* d);
  uint32_t n_noise;
  uint64_t (*packed_size)(const cardan_param_values*); /* [setup] (optional) bytes of this instance, in place of params_size */
  /* [step: pure] Of the mount CARDAN_MOUNT_MASS: a function of packed, z and d (in and mount are null). 0 = done. It falls by the sum of
   * the inputs in kg/s, and by nothing else: a law. What a device that has an outlet gives to such an input leaves there. */
  int (*mass)(const cardan_device_args*, cardan_mass*);
  /* [step: pure] (optional) Its derivative along dz. Null: by differences. */
  int (*mass_tangent)(const cardan_device_args*, const double* dz, cardan_mass*);
  /* [step: pure] (optional) [N m s] angular momentum that is stored beside that of bodies, per mount, axes of the node: what its loads take
   * from the bodies goes there, all of it. */
  void (*momentum)(const cardan_device_args*, double (*h)[3]);
  /* [step: pure] Of CARDAN_USE_HOLD: [N m, N] the most that it holds its component with. The host finds the force that holds, and where
   * that passes the most: `event` with root = n_roots + 1, direction that in which it then begins to move. */
  double (*holds)(const cardan_device_args*);
  /* [step: pure] (optional) z' once v' is known, of states that are integrals of what accelerations cause: the velocity that an IMU adds
   * up. It is affine in these: where velocities jump, z jumps by what alpha, specific_force and vdot that are their jumps add to it.
   * `evaluate` then gives no zdot, nor does its tangent. Reads t, packed, z and mounts at nodes, with alpha and specific_force,
   * whatever their use; in and d are null, hinge components are there with vdot, of fields nothing. 0 = done, else the step is tried again
   * smaller. */
  int (*follow)(const cardan_device_args*, double* zdot);
  /* [step: pure] (optional) Its derivative along z and mounts of `along`. Null: by differences. */
  int (*follow_tangent)(const cardan_device_args*, const cardan_device_args* along, double* zdot);
  const char* (*explain)(const void* packed, int code); /* (optional) What a code other than 0 means that one of its functions returned */
  uint32_t role;                                        /* cardan_device_role */
  /* Since 2.2. [accepted] (optional) What it pushes with all at once, [N s] and [N m s], just before `event` at a root of its own (cause:
   * its number, from 0) or before `tick` (CARDAN_CAUSE_TICK, direction 0), with the same arguments. Loads that are zero before the call, at
   * mounts with CARDAN_USE_IMPULSE or CARDAN_USE_LOAD. Poses stay, velocities jump by what the whole vehicle gives way: held components
   * too. 0 = done. */
  int (*impulse)(const cardan_device_args*, uint32_t cause, int direction, cardan_mount_load* impulse);
} cardan_device_family;

#ifdef __cplusplus
}
#endif
#endif
