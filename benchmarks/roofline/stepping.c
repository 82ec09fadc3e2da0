/* The control step of ropes and cloths in plain C: what the Python kernels are measured against.
 *
 * The same operations in the same order as pbd_gym/physics/kernels, so that both give the same
 * bits, for models of chains, distances and bends. LANES worlds stand side by side in scratch rows;
 * with LANES = 1 this is ordinary scalar code. Compiled with -DDIM=... -DLANES=... -DREAL=...
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

typedef REAL real;
typedef int32_t place;
_Static_assert(sizeof(real) == 4 || sizeof(real) == 8, "float or double");
#define SQRT(value) (sizeof(real) == 4 ? (real)sqrtf((float)(value)) : (real)sqrt((double)(value)))
#define LANE_LOOP _Pragma("GCC ivdep") for (int lane = 0; lane < LANES; lane++)

struct model {
  place particles, pins, chains, distances, bends;
  const place *pin, *offset, *entry, *pair, *triple;
  const real *inverse_mass, *gravity;
  const real *rest, *compliance, *greatest; /* of the links, by entry */
  const real *length, *softness;            /* of the distances */
  const real *bend_compliance;
  real dt, h, inverse_h2, decay, speed_limit;
};

/* One particle in all lanes; the last four serve the link to the next particle of its chain. */
typedef struct {
  real x[DIM][LANES], start[DIM][LANES], v[DIM][LANES];
  real direction[DIM][LANES], coupling[LANES], pivot[LANES], multiplier[LANES];
} row;

static const row nothing; /* the missing neighbour of a chain's first and last link */

static inline int64_t world_of(int64_t tile, int lane, int64_t worlds) {
  int64_t world = tile * LANES + lane;
  return world < worlds ? world : worlds - 1;
}

static void load(const struct model *m, int64_t tile, int64_t worlds, const real *x, const real *v,
                 row *work) {
  for (place i = 0; i < m->particles; i++)
    for (int lane = 0; lane < LANES; lane++) {
      int64_t at = (world_of(tile, lane, worlds) * m->particles + i) * DIM;
      for (int k = 0; k < DIM; k++) {
        work[i].x[k][lane] = x[at + k];
        work[i].v[k][lane] = v[at + k];
      }
    }
}

static void store(const struct model *m, int64_t tile, int64_t worlds, real *x, real *v,
                  const row *work) {
  int64_t used = worlds - tile * LANES < LANES ? worlds - tile * LANES : LANES;
  for (place i = 0; i < m->particles; i++)
    for (int lane = 0; lane < used; lane++) {
      int64_t at = ((tile * LANES + lane) * m->particles + i) * DIM;
      for (int k = 0; k < DIM; k++) {
        x[at + k] = work[i].x[k][lane];
        v[at + k] = work[i].v[k][lane];
      }
    }
}

static void move_pins(const struct model *m, int64_t tile, int64_t worlds, const real *x,
                      const real *targets, row *work, real remaining) {
  for (place p = 0; p < m->pins; p++)
    for (int lane = 0; lane < LANES; lane++) {
      int64_t world = world_of(tile, lane, worlds);
      for (int k = 0; k < DIM; k++) {
        real target = targets[(world * m->pins + p) * DIM + k];
        real move = target - x[(world * m->particles + m->pin[p]) * DIM + k];
        work[m->pin[p]].x[k][lane] = target - move * remaining;
      }
    }
}

static void aim_pins(const struct model *m, int64_t tile, int64_t worlds, const real *x,
                     const real *targets, row *work) {
  for (place p = 0; p < m->pins; p++)
    for (int lane = 0; lane < LANES; lane++) {
      int64_t world = world_of(tile, lane, worlds);
      for (int k = 0; k < DIM; k++) {
        real move = targets[(world * m->pins + p) * DIM + k] -
                    x[(world * m->particles + m->pin[p]) * DIM + k];
        work[m->pin[p]].v[k][lane] = move / m->dt;
      }
    }
}

static void predict(const struct model *m, row *work) {
  for (place i = 0; i < m->particles; i++)
    for (int k = 0; k < DIM; k++) {
      real kick = m->gravity[k] * m->h, *x = work[i].x[k], *v = work[i].v[k];
      memcpy(work[i].start[k], x, sizeof work[i].start[k]);
      if (m->inverse_mass[i] > 0)
        LANE_LOOP {
          v[lane] = v[lane] * m->decay + kick;
          x[lane] += v[lane] * m->h;
        }
    }
}

static void bend(row *a, row *b, row *c, real w_a, real w_b, real w_c, real alpha) {
  real total = w_a + 4 * w_b + w_c, share = total > 0 ? 1 / (total + alpha) : 0;
  for (int k = 0; k < DIM; k++)
    LANE_LOOP {
      real move = share * (a->x[k][lane] - 2 * b->x[k][lane] + c->x[k][lane]);
      a->x[k][lane] -= w_a * move;
      b->x[k][lane] += 2 * w_b * move;
      c->x[k][lane] -= w_c * move;
    }
}

static void distance(row *a, row *b, real w_a, real w_b, real rest, real alpha) {
  real total = w_a + w_b + alpha, share = total > 0 ? 1 / total : 0;
  LANE_LOOP {
    real delta[DIM], square = 0;
    for (int k = 0; k < DIM; k++) {
      delta[k] = a->x[k][lane] - b->x[k][lane];
      square += delta[k] * delta[k];
    }
    real length = SQRT(square);
    real scale = length > 0 ? share * (1 - rest / length) : 0;
    for (int k = 0; k < DIM; k++) {
      real move = scale * delta[k];
      a->x[k][lane] -= w_a * move;
      b->x[k][lane] += w_b * move;
    }
  }
}

static void eliminate(const row *before, row *a, const row *b, real w_a, real w_b, real rest,
                      real alpha) {
  real diagonal = w_a + w_b + alpha, least = (real)1e-5 * diagonal;
  LANE_LOOP {
    real delta[DIM], square = 0, cosine = 0;
    for (int k = 0; k < DIM; k++) {
      delta[k] = a->x[k][lane] - b->x[k][lane];
      square += delta[k] * delta[k];
    }
    real length = SQRT(square), inverse = length > 0 ? 1 / length : 0;
    for (int k = 0; k < DIM; k++) {
      real direction = delta[k] * inverse;
      cosine += direction * before->direction[k][lane];
      a->direction[k][lane] = direction;
    }
    real coupling = -w_a * cosine, factor = coupling * before->pivot[lane];
    real pivot = diagonal - factor * coupling;
    pivot = pivot < least ? least : pivot;
    a->coupling[lane] = coupling;
    a->pivot[lane] = pivot > 0 ? 1 / pivot : 0;
    a->multiplier[lane] = length - rest - factor * before->multiplier[lane];
  }
}

static void substitute(row *a, row *b, const row *after, real w_a, real w_b) {
  LANE_LOOP {
    real above = after->coupling[lane] * after->multiplier[lane];
    real step = (a->multiplier[lane] - above) * a->pivot[lane];
    a->multiplier[lane] = step;
    for (int k = 0; k < DIM; k++) {
      real move = step * a->direction[k][lane];
      a->x[k][lane] -= w_a * move;
      b->x[k][lane] += w_b * move;
    }
  }
}

static void shorten(row *a, row *b, real w_a, real w_b, real greatest) {
  real total = w_a + w_b, share = total > 0 ? 1 / total : 0;
  int longer = 0;
  LANE_LOOP {
    real square = 0;
    for (int k = 0; k < DIM; k++) {
      real delta = a->x[k][lane] - b->x[k][lane];
      square += delta * delta;
    }
    longer |= square > greatest * greatest;
  }
  if (!longer) return;
  LANE_LOOP {
    real delta[DIM], square = 0;
    for (int k = 0; k < DIM; k++) {
      delta[k] = a->x[k][lane] - b->x[k][lane];
      square += delta[k] * delta[k];
    }
    real scale = square > greatest * greatest ? share * (1 - greatest / SQRT(square)) : 0;
    for (int k = 0; k < DIM; k++) {
      real move = scale * delta[k];
      a->x[k][lane] -= w_a * move;
      b->x[k][lane] += w_b * move;
    }
  }
}

static void project(const struct model *m, row *work) {
  const real *w = m->inverse_mass;
  for (place i = 0; i < m->bends; i++) {
    const place *t = m->triple + 3 * i;
    bend(work + t[0], work + t[1], work + t[2], w[t[0]], w[t[1]], w[t[2]],
         m->bend_compliance[i] * m->inverse_h2);
  }
  for (place i = 0; i < m->distances; i++) {
    const place *p = m->pair + 2 * i;
    distance(work + p[0], work + p[1], w[p[0]], w[p[1]], m->length[i],
             m->softness[i] * m->inverse_h2);
  }
  for (place chain = 0; chain < m->chains; chain++) {
    place first = m->offset[chain], last = m->offset[chain + 1] - 1;
    const row *next = &nothing;
    for (place e = first; e < last; e++) {
      place i = m->entry[e], j = m->entry[e + 1];
      eliminate(next, work + i, work + j, w[i], w[j], m->rest[e], m->compliance[e] * m->inverse_h2);
      next = work + i;
    }
    next = &nothing;
    for (place e = last - 1; e >= first; e--) {
      place i = m->entry[e], j = m->entry[e + 1];
      substitute(work + i, work + j, next, w[i], w[j]);
      next = work + i;
    }
  }
  for (place turn = 0; turn < 2 * m->chains; turn++) {
    place chain = turn < m->chains ? turn : 2 * m->chains - 1 - turn;
    for (place e = m->offset[chain]; e < m->offset[chain + 1] - 1; e++)
      if (m->greatest[e] < INFINITY) {
        place i = m->entry[e], j = m->entry[e + 1];
        shorten(work + i, work + j, w[i], w[j], m->greatest[e]);
      }
  }
}

static void read_velocities(const struct model *m, row *work) {
  for (place i = 0; i < m->particles; i++)
    if (m->inverse_mass[i] > 0)
      for (int k = 0; k < DIM; k++)
        LANE_LOOP work[i].v[k][lane] = (work[i].x[k][lane] - work[i].start[k][lane]) / m->h;
}

static int is_too_fast(const struct model *m, const row *work) {
  real square[LANES] = {0};
  int any = 0;
  for (place i = 0; i < m->particles; i++)
    for (int k = 0; k < DIM; k++)
      LANE_LOOP square[lane] += work[i].v[k][lane] * work[i].v[k][lane];
  LANE_LOOP any |= !(square[lane] <= m->speed_limit * m->speed_limit);
  return any;
}

int64_t row_size(void) { return sizeof(row); }

/* Returns whether a world ended beyond the speed limit, where ours would begin again. */
int advance(const struct model *m, int64_t worlds, int64_t substeps, real *x, real *v,
            const real *targets, row *work) {
  int failed = 0;
  for (int64_t tile = 0; tile * LANES < worlds; tile++) {
    load(m, tile, worlds, x, v, work);
    aim_pins(m, tile, worlds, x, targets, work);
    for (int64_t substep = 0; substep < substeps; substep++) {
      predict(m, work);
      move_pins(m, tile, worlds, x, targets, work,
                (real)(substeps - 1 - substep) / (real)substeps);
      project(m, work);
      read_velocities(m, work);
    }
    failed |= is_too_fast(m, work);
    store(m, tile, worlds, x, v, work);
  }
  return failed;
}
