/* An example of glue: the reference axis under CANopenNode 4. See ../PORTING.md. */
#ifndef LAX_GLUE_H
#define LAX_GLUE_H

#include "CANopen.h"
#include "axis.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LAX_GLUE_OBJECTS 28 /* of the dictionary, for which the axis answers */

typedef struct {
    lax_axis_t axis;
    OD_extension_t extensions[LAX_GLUE_OBJECTS];
    OD_entry_t *heartbeat_consumer; /* 0x1016, which the stack answers for */
    OD_entry_t *rpdo1;              /* 0x1400, likewise */
    volatile bool heard_host;       /* set where frames are received, perhaps in an interrupt */
    bool within_rpdo;               /* a PDO is unpacked now, not an SDO answered */
    bool has_controlword;           /* that PDO has brought one */
    bool has_target;                /* likewise */
    uint16_t controlword;
    int32_t target;     /* [increments] */
    uint32_t inputs;    /* 0x60FD as it was sent last */
    int64_t mode;       /* 0x6061 as it was sent last */
} lax_glue_t;

/* In the communication reset section, between CO_CANopenInit and CO_CANopenInitPDO.
 * Returns 0, or the index of an object that the dictionary lacks. */
uint16_t lax_glue_init(lax_glue_t *glue, CO_t *co, OD_t *od);

/* In the control task, at every period: in the place of CO_process_SYNC, CO_process_RPDO and
 * CO_process_TPDO. dt: since the last call [us]; encoder: [increments]. */
void lax_glue_process(lax_glue_t *glue, CO_t *co, uint32_t dt, int64_t encoder);

#ifdef __cplusplus
}
#endif

#endif
