/* The plugin contract: the only header a plugin needs. C11 and C++20; nothing of Cardan is linked.
 *
 * Rules: majors must match; a struct_size (of families and of the plugin) that is too small is refused; fields are
 * appended at struct ends only; no exceptions, no C++ types, no ownership across the line; no load-time constructors.
 * Call contexts: [setup] before the run, may allocate; [step: pure] inside a right-hand side, no allocation, no state,
 * called from any thread. All numbers in SI; matrices column-major unless stated. */
#ifndef CARDAN_ABI_H
#define CARDAN_ABI_H
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CARDAN_ABI_MAJOR 1u /* binary break: the host refuses */
#define CARDAN_ABI_MINOR 1u /* fields appended */

/* What the family is built of: the host's own sweep kernels serve the axis shapes. */
enum cardan_hinge_shape {
  CARDAN_SHAPE_FIXED = 0,     /* no velocity */
  CARDAN_SHAPE_ROTATION = 1,  /* R = exp(u~ q), l = 0 */
  CARDAN_SHAPE_SLIDE = 2,     /* R = I, l = u q */
  CARDAN_SHAPE_SCREW = 3,     /* R = exp(u~ q), l = pitch q u */
  CARDAN_SHAPE_BALL = 4,      /* quaternion, v = omega of P in O, P axes */
  CARDAN_SHAPE_FREE = 5,      /* quaternion + position; v = [omega in P axes; position rate in O axes] */
  CARDAN_SHAPE_FREE_BODY = 6, /* quaternion + position; v = [omega; linear velocity], both in P axes */
  CARDAN_SHAPE_DENSE = 7      /* anything else: kinematics() fills the record */
};

enum cardan_param_kind {
  CARDAN_NUMBER = 0,  /* one number */
  CARDAN_VECTOR = 1,  /* 3 numbers */
  CARDAN_VECTORS = 2, /* a list of vectors of 3 */
  CARDAN_TEXT = 3,
  CARDAN_UNIT_VECTOR = 4, /* 3 numbers, normalised by the host; zero is refused */
  CARDAN_UNIT_VECTORS = 5
};

/* One parameter of a family: drives the check of the input, the error messages and the documentation. */
typedef struct cardan_param_desc {
  const char* name;
  uint32_t kind;       /* cardan_param_kind */
  const char* unit;    /* "m", "rad", "m/rad", "kg", "1" */
  uint32_t required;   /* 1: an error when absent */
  double fallback[3];  /* value when absent: the number, or the vector */
  uint32_t count;      /* VECTORS kinds: how many vectors; 0 = any */
  const char* meaning; /* one line */
} cardan_param_desc;

/* The checked values of one instance. Names are those of the schema; a call with another name returns null. */
typedef struct cardan_param_values {
  uint32_t struct_size;
  const void* host;
  const double* (*numbers)(const struct cardan_param_values*, const char* name, uint32_t* count);
  const char* (*text)(const struct cardan_param_values*, const char* name);
  void (*fail)(const struct cardan_param_values*, const char* name, const char* expected); /* reports an error at that key */
} cardan_param_values;

/* Hinge kinematics. O: hinge frame on the inboard body, P: hinge frame on the body.
 * R_OP maps P axes to O axes (row-major), p_OP: position of P in O, O axes [m].
 * Ht: column j = spatial velocity [angular; linear] of P in O per unit v_j, in P axes.
 * Hdot_v: (d/dt Ht) v in P axes. */
typedef struct cardan_hinge_out {
  double R_OP[9];
  double p_OP[3];
  double Ht[36]; /* 6 x nv, column-major */
  double Hdot_v[6];
} cardan_hinge_out;

/* One table per hinge type, built-in or not. Functions marked (optional) may be null. */
typedef struct cardan_hinge_family {
  uint32_t struct_size;
  const char* type;    /* "acme/helix"; no slash is reserved for built-ins */
  const char* summary; /* one line for `describe` and the documentation */
  uint32_t nq, nv;
  uint32_t shape;       /* cardan_hinge_shape; a declared fact: the laws compare R, l, Ht, N with the host's own formulas */
  uint32_t params_size; /* bytes of the packed parameters, trivially copyable, align 8 */
  const cardan_param_desc* params;
  uint32_t n_params;
  const char* const* q_names;                                  /* nq names, for results */
  const char* const* v_names;                                  /* nv names */
  const char* const* q_units;                                  /* nq units ("rad", "m", "1") */
  const char* const* v_units;                                  /* nv units */
  int (*pack)(const cardan_param_values*, void* packed);       /* [setup] 0 = done */
  int (*axis)(const void* packed, double u[3], double* pitch); /* [setup] rotation, slide, screw only (else null) */
  void (*zero)(const void* packed, double* q);                 /* [setup] (optional) initial q; default 0 */
  /* [step: pure] Hinge j of the batch reads q + iq[j], v + iv[j] and its parameters at packed + j * params_size. */
  void (*kinematics)(const void* packed, uint32_t n, const uint32_t* iq, const uint32_t* iv, const double* q, const double* v,
                     cardan_hinge_out* out);
  void (*qdot)(const void* packed, const double* q, const double* v, double* qdot); /* [step: pure] qdot = N(q) v */
  /* Derivative of Ht along u (q moves by N(q) u), 6 x nv. map_dot(q, v) v = Hdot_v. */
  void (*map_dot)(const void* packed, const double* q, const double* u, double* Ht_dot); /* [step: pure] */
  void (*normalise)(const void* packed, double* q);                                      /* [step: pure] (optional) */
  void (*retract)(const void* packed, const double* q, const double* d, double* q_out);  /* [step: pure] (optional when nq = nv) */
  void (*difference)(const void* packed, const double* q1, const double* q2, double* d); /* (optional when nq = nv) */
} cardan_hinge_family;

/* Modal data of a flexible body in the body frame B, as the host hands it to a body family. n_modes = m; matrices are
 * column-major; I5: 3 x m per l, one after the other; I8: m of 3 x 3; I9: m * m of 3 x 3, index l * m + k. Pointers that
 * do not apply are null. Symbols: docs/mathematics (Shabana 2013 numbering). */
typedef struct cardan_modal_view {
  uint32_t struct_size, n_modes, level;
  double I1;
  const double *I2, *I3, *I4, *I5, *I6, *I7, *I8, *I9;
  const double *rotary_ww, *rotary_we, *rotary_ee; /* m of 3 x 3; m of 3 x m; m of m x m; null: no rotary terms */
  uint32_t n_mass_nodes;                           /* lumped masses, for the nodal form */
  const double *node_mass, *node_position;         /* n; 3 n */
  const double* node_inertia;                      /* 9 n, or null */
  const double *node_Phi, *node_Psi;               /* 3 x m each; node_Psi may be null */
  const double* node_Q;                            /* 3 matrices m x m per node, or null */
} cardan_modal_view;

typedef struct cardan_body_facts {
  uint32_t struct_size;
  uint32_t m_ee_constant; /* M_ee does not depend on eta */
  uint32_t m_re_constant; /* M_we and M_ve do not depend on eta */
  /* J does not either (since 1.1). With all three only the mass centre moves, by M_ve eta, and one kinetic energy is left:
   * the host forms mass and bias itself and does not call the family in a step. */
  uint32_t j_constant;
} cardan_body_facts;

/* One table per body type: the inertia that the operator framework asks of a body, nothing else. Nodes, stiffness, damping,
 * gravity are the host's. A family without modes leaves the functions null: its mass properties are constants. */
typedef struct cardan_body_family {
  uint32_t struct_size;
  const char* type;
  const char* summary;
  uint32_t has_modes;
  uint64_t (*packed_size)(const cardan_modal_view*);           /* [setup] */
  int (*pack)(const cardan_modal_view*, void* packed);         /* [setup] 0 = done */
  void (*facts)(const void* packed, cardan_body_facts* facts); /* [setup] */
  /* [step: pure] M_rr: m, m c (3), J about B (xx yy zz xy xz yz); M_re: 6 x m = [M_we; M_ve]; M_ee: m x m. Null: not wanted. */
  void (*mass)(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee);
  /* [step: pure] Velocity terms in gamma form, left-hand side, b = [b_w; b_v; b_e], from the same truncation as `mass`. */
  void (*bias)(const void* packed, const double* eta, const double* etadot, const double* omega, double* b);
} cardan_body_family;

/* One plugin: name, version and its families, asked for by kind ("hinge"; no other kind yet) and index until null. */
typedef struct cardan_plugin {
  uint32_t struct_size, abi_major, abi_minor;
  const char *name, *version, *licence;
  const void* (*family)(const char* kind, uint32_t index); /* [setup] */
} cardan_plugin;

typedef struct cardan_host {
  uint32_t struct_size, abi_major, abi_minor;
} cardan_host;

/* The only exported symbol of a plugin: returns a table that lives as long as the library, or null to refuse. */
#if defined(__GNUC__)
#define CARDAN_EXPORT __attribute__((visibility("default")))
#else
#define CARDAN_EXPORT
#endif
CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host*);
typedef const cardan_plugin* (*cardan_plugin_entry_fn)(const cardan_host*);

#ifdef __cplusplus
}
#endif
#endif
