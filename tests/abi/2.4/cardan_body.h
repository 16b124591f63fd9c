/* The table of a body. */
#ifndef CARDAN_BODY_H
#define CARDAN_BODY_H
#include "cardan_abi.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CARDAN_KIND_BODY "body"

/* Where the mass properties of a body come from: which keys its description has. */
enum cardan_mass_source {
  CARDAN_MASS_RIGID = 0,    /* mass, com, inertia, nodes */
  CARDAN_MASS_POINT = 1,    /* mass, com, nodes: no extent */
  CARDAN_MASS_COMPUTED = 2, /* nodes; rigid() gives the rest from the parameters */
  CARDAN_MASS_MODES = 3     /* modal, level: the body has modes, and mass() and bias() give its inertia */
};

/* A named node of the modal data, undeformed. */
typedef struct cardan_modal_node {
  const char* name;
  double R_BN[9], position[3]; /* row-major, node axes to body axes; [m] from B */
  const double* shapes;        /* 6 x m, column-major: [psi; phi] per mode, [rad; m]; zero where the data have none */
} cardan_modal_node;

/* Modal data of a flexible body in the body frame B, as the host hands it to a body family. n_modes = m; matrices are
 * column-major; I5: 3 x m per l, one after the other; I8: m of 3 x 3; I9: m * m of 3 x 3, index l * m + k. Pointers that
 * do not apply are null. Symbols: docs/mathematics (Shabana 2013 numbering). */
typedef struct cardan_modal_view {
  uint32_t struct_size, n_modes, level;
  double I1;
  const double *I2, *I3, *I4, *I5, *I6, *I7, *I8, *I9;
  const double *rotary_ww, *rotary_we, *rotary_ee; /* m of 3 x 3; m of 3 x m; m of m x m; null: none, the last two also alone */
  uint32_t n_mass_nodes;                           /* lumped masses, for the nodal form */
  const double *node_mass, *node_position;         /* n; 3 n */
  const double* node_inertia;                      /* 9 n, or null */
  const double *node_Phi, *node_Psi;               /* 3 x m each; node_Psi may be null */
  const double* node_Q;                            /* 3 matrices m x m per node, or null */
  uint32_t n_nodes, node_size;                     /* named nodes, to which hinges, loads and sensors attach; sizeof of one */
  const cardan_modal_node* nodes;
} cardan_modal_view;

/* All 0 before the call. Each is proven by the laws. */
typedef struct cardan_body_facts {
  uint32_t struct_size;
  uint32_t m_ee_constant; /* M_ee does not depend on eta */
  uint32_t m_re_constant; /* M_we and M_ve do not depend on eta */
  /* J does not either. With all three only the mass centre moves, by M_ve eta, and one kinetic energy is left: the host forms mass
   * and bias itself and does not call the family in a step. */
  uint32_t j_constant;
  uint32_t states; /* `states` of the table may be called for this body (2.4) */
} cardan_body_facts;

/* One table per body type: the inertia that the operator framework asks of a body and, where its nodes do not move along constant
 * shapes, how they move. Stiffness, damping, gravity are the host's. Functions of modes are null in other bodies; rigid() is null but in
 * CARDAN_MASS_COMPUTED. */
typedef struct cardan_body_family {
  uint32_t struct_size;
  const char* type;
  const char* summary;
  uint32_t mass_source; /* cardan_mass_source */
  uint32_t n_params, param_size;
  const cardan_param_desc* params; /* keys of its own, beside those of its mass source */
  /* [setup] 0 = done. mass [kg], mass centre [m] and inertia about it [kg m^2] (xx yy zz xy xz yz), axes of B. */
  int (*rigid)(const cardan_param_values*, double* mass, double com[3], double inertia[6]);
  uint64_t (*packed_size)(const cardan_param_values*, const cardan_modal_view*);   /* [setup] bytes, align 8 */
  int (*pack)(const cardan_param_values*, const cardan_modal_view*, void* packed); /* [setup] 0 = done */
  void (*facts)(const void* packed, cardan_body_facts* facts);                     /* [setup] (optional) */
  /* [step: pure] M_rr: m, m c (3), J about B (xx yy zz xy xz yz); M_re: 6 x m = [M_we; M_ve]; M_ee: m x m. Null: not wanted. */
  void (*mass)(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee);
  /* [step: pure] Velocity terms in gamma form, left-hand side, b = [b_w; b_v; b_e], from the same truncation as `mass`. */
  void (*bias)(const void* packed, const double* eta, const double* etadot, const double* omega, double* b);
  /* [step: pure] (optional; null: x = S eta with the shapes of the modal data) How node number `node` of the modal data has moved in B:
   * x = [theta; u], R = exp(theta~) R_BN, position + u [rad; m], zero at eta = 0; S = dx/d eta (6 x m); a = S' eta', its derivative at
   * constant eta' (6). B axes. Null: not wanted; without a, etadot may be null too. */
  void (*node)(const void* packed, uint32_t node, const double* eta, const double* etadot, double* x, double* S, double* a);
  /* [step: pure] (optional, 2.4) `mass` and, unless etadot is null, `bias` of n states side by side: number i of state l stands at [i n +
   * l], arrays are aligned to 8 n bytes. n = 2, 4 or 8, the lanes of a register: 4 is asked of processors with AVX2 alone, 8 of those with
   * AVX-512. Each state has the same bits as by itself. M_re and M_ee may be null, M_rr is not. */
  void (*states)(const void* packed, uint32_t n, const double* eta, const double* etadot, const double* omega, double* M_rr, double* M_re,
                 double* M_ee, double* b);
} cardan_body_family;

#ifdef __cplusplus
}
#endif
#endif
