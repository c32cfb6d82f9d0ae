#ifndef LAX_OBJECTS_H
#define LAX_OBJECTS_H

#include "axis.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LAX_MODE_HOMING 6
#define LAX_MODE_CSP 8

void lax_objects_init(lax_objects_t *o);
uint32_t lax_objects_write(lax_objects_t *o, uint32_t key, int64_t value);
uint32_t lax_objects_read(const lax_objects_t *o, uint32_t key, int64_t *value);

#ifdef __cplusplus
}
#endif

#endif
