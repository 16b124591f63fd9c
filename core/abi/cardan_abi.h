/* The plugin contract: what every plugin needs, and the table of a hinge. Other kinds have headers of their own beside this
 * one, cardan_body.h first. C11 and C++20; nothing of Cardan is linked.
 *
 * Rules. Majors must match; the host takes the same or an older minor. Every table begins with its struct_size, and arrays of
 * descriptions carry the size of an element: members are appended at the ends only, and the host reads of a table what its
 * size says is there; the rest is zero. A size that does not hold what the kind needs is refused. What a step hands to and
 * takes from a function (cardan_hinge_out, arrays of double) keeps its form within a major. No exceptions, no C++ types, no
 * ownership across the line; tables and their texts live as long as the library; no load-time constructors.
 * Call contexts: [setup] before the run, may allocate; [step: pure] inside a right-hand side, no allocation, no state, called
 * from any thread. All numbers in SI; matrices column-major unless stated. */
#ifndef CARDAN_ABI_H
#define CARDAN_ABI_H
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CARDAN_ABI_MAJOR 2u /* binary break: the host refuses */
/* Fields appended, kinds added: devices and fields since 1; valid and impulse of devices since 2; bodies since 3; edges of fields since
 * 6. */
#define CARDAN_ABI_MINOR 6u

/* ---- parameters: what the description of an instance may say, and what its family is told ---- */

enum cardan_param_kind {
  CARDAN_NUMBER = 0,  /* one number */
  CARDAN_VECTOR = 1,  /* 3 numbers */
  CARDAN_VECTORS = 2, /* a list of vectors of 3 */
  CARDAN_TEXT = 3,
  CARDAN_UNIT_VECTOR = 4, /* 3 numbers, normalised by the host; zero is refused */
  CARDAN_UNIT_VECTORS = 5,
  CARDAN_INTEGER = 6, /* a whole number */
  CARDAN_TRUTH = 7,   /* true or false: 1 or 0 */
  CARDAN_CHOICE = 8,  /* one of `names`: its index, and the text */
  CARDAN_FILE = 9,    /* a file, named relative to the description: its path and its bytes. Its hash stands in the results */
  CARDAN_TABLE = 10   /* rows of `count` numbers, in place or in a CSV file, whose hash stands in the results as well */
};

enum cardan_param_flag {
  CARDAN_REQUIRED = 1u, /* an error when absent */
  CARDAN_ABOVE = 2u,    /* `lower` itself is not in the range */
  CARDAN_BELOW = 4u,    /* nor is `upper` */
  CARDAN_EACH = 8u      /* since 2.6. Of a VECTOR: the description may give one number for all three */
};

/* One parameter: drives the check of the input, the error messages and the documentation. The host checks kind, unit, range and
 * count before it calls pack. */
typedef struct cardan_param_desc {
  const char* name;
  uint32_t kind;            /* cardan_param_kind */
  uint32_t flags;           /* cardan_param_flag */
  const char* unit;         /* "m", "rad", "m/rad", "kg", "1"; not read of texts, truths, choices and files */
  const char* meaning;      /* one line */
  double fallback[3];       /* value when absent: number, vector, truth, index of the choice. Lists, texts, files and tables have none */
  double lower, upper;      /* range of each number; infinite: open on that side; both 0: any number. Not read of tables */
  uint32_t count;           /* VECTORS kinds: how many vectors, 0 = any; CHOICE: how many names; TABLE: how many columns */
  const char* const* names; /* CHOICE: the texts; TABLE: what its columns are called */
  const char* const* units; /* TABLE: of each column; null: `unit` for all */
} cardan_param_desc;

/* The checked values of one instance. Names are those of the schema; a call with another name, or of what is absent and has no
 * fallback, returns null. */
typedef struct cardan_param_values {
  uint32_t struct_size;
  const void* host;
  /* Numbers, vectors one after the other, truths (0, 1), choices (index), tables row after row; `count` numbers in all, may be
   * null. */
  const double* (*numbers)(const struct cardan_param_values*, const char* name, uint32_t* count);
  const char* (*text)(const struct cardan_param_values*, const char* name);                  /* texts, choices; the path of a file */
  const void* (*bytes)(const struct cardan_param_values*, const char* name, uint64_t* size); /* the content of a file */
  /* Refuses: tells what was expected at that key (null: of the instance as a whole), what was got (null: the value that stands
   * there) and what may help (null: nothing). The function that calls it then returns non-zero. */
  void (*fail)(const struct cardan_param_values*, const char* name, const char* expected, const char* got, const char* hint);
} cardan_param_values;

/* ---- hinges: kind "hinge" ---- */

#define CARDAN_KIND_HINGE "hinge"

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
  uint32_t params_size; /* bytes of the packed parameters, trivially copyable, align 8; see packed_size */
  const cardan_param_desc* params;
  uint32_t n_params;
  uint32_t param_size;                                          /* sizeof(cardan_param_desc): from one to the next */
  const char* const* q_names;                                   /* nq names, for results */
  const char* const* v_names;                                   /* nv names */
  const char* const* q_units;                                   /* nq units ("rad", "m", "1") */
  const char* const* v_units;                                   /* nv units */
  int (*pack)(const cardan_param_values*, void* packed);        /* [setup] 0 = done; else see cardan_param_values.fail */
  void (*axis)(const void* packed, double u[3], double* pitch); /* [setup] rotation, slide, screw only (else null) */
  /* [step: pure] Hinge j of the batch reads q + iq[j], v + iv[j] and its parameters at packed + j * params_size. */
  void (*kinematics)(const void* packed, uint32_t n, const uint32_t* iq, const uint32_t* iv, const double* q, const double* v,
                     cardan_hinge_out* out);
  void (*qdot)(const void* packed, const double* q, const double* v, double* qdot); /* [step: pure] qdot = N(q) v */
  /* The rest may be beyond struct_size. All four functions of the manifold of q, or none where nq = nv. */
  void (*zero)(const void* packed, double* q);                                           /* [setup] (optional) initial q; default 0 */
  void (*normalise)(const void* packed, double* q);                                      /* [step: pure] (optional) */
  void (*retract)(const void* packed, const double* q, const double* d, double* q_out);  /* [step: pure] (optional) */
  void (*difference)(const void* packed, const double* q1, const double* q2, double* d); /* (optional) */
  /* [setup] (optional) Bytes of the packed parameters of this instance, in place of params_size: a table, a curve. `kinematics`
   * is then called for one hinge at a time, n = 1. */
  uint64_t (*packed_size)(const cardan_param_values*);
} cardan_hinge_family;

/* ---- the plugin and its host ---- */

/* One plugin: name, version and its families, asked for by kind (CARDAN_KIND_HINGE ...) and index until null. */
typedef struct cardan_plugin {
  uint32_t struct_size, abi_major, abi_minor;
  const char *name, *version, *licence;
  const void* (*family)(const char* kind, uint32_t index); /* [setup] */
} cardan_plugin;

/* Lives as long as the library. */
typedef struct cardan_host {
  uint32_t struct_size, abi_major, abi_minor;
  const void* (*service)(const struct cardan_host*, const char* id); /* null: this host does not offer it */
} cardan_host;

/* Something to say to the user. From any thread, but not in a step, whose functions are pure. */
#define CARDAN_SERVICE_LOG "log"
enum cardan_log_severity { CARDAN_LOG_INFO = 0, CARDAN_LOG_WARNING = 1, CARDAN_LOG_ERROR = 2 };
typedef struct cardan_log {
  uint32_t struct_size;
  void (*say)(const struct cardan_log*, uint32_t severity, const char* text);
} cardan_log;

/* The only exported symbol of a plugin: returns a table that lives as long as the library, or null to refuse (an error said to the
 * log before tells why). */
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
