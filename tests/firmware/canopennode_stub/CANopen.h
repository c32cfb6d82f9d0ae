/* As much of CANopenNode 4 as the glue in firmware_interface/canopennode asks for: names, types
 * and meaning as its headers give them. It stands in for the stack where tests compile and run the
 * glue; a drive has the real one. */
#ifndef CANOPEN_STUB_H
#define CANOPEN_STUB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef bool bool_t;
typedef uint32_t OD_size_t;
typedef uint8_t OD_attr_t;

#define OD_FLAGS_PDO_SIZE 4U

typedef enum {
    ODR_OK = 0,
    ODR_IDX_NOT_EXIST = 5,
    ODR_DEV_INCOMPAT = 9,
    ODR_TYPE_MISMATCH = 11,
    ODR_SUB_NOT_EXIST = 14,
    ODR_INVALID_VALUE = 15,
    ODR_VALUE_HIGH = 16,
    ODR_VALUE_LOW = 17,
    ODR_DATA_DEV_STATE = 23
} ODR_t;

typedef struct {
    void *dataOrig;
    void *object;
    OD_size_t dataLength;
    OD_size_t dataOffset;
    OD_attr_t attribute;
    uint16_t index;
    uint8_t subIndex;
} OD_stream_t;

typedef struct {
    void *object;
    ODR_t (*read)(OD_stream_t *stream, void *buf, OD_size_t count, OD_size_t *countRead);
    ODR_t (*write)(OD_stream_t *stream, const void *buf, OD_size_t count,
                   OD_size_t *countWritten);
    uint8_t flagsPDO[OD_FLAGS_PDO_SIZE];
} OD_extension_t;

typedef struct {
    uint16_t index;
    uint32_t original; /* of the stub: what the one sub-index that it keeps holds */
    OD_extension_t *extension;
} OD_entry_t;

typedef struct {
    uint16_t size;
    OD_entry_t *list;
} OD_t;

typedef enum { CO_NMT_PRE_OPERATIONAL = 127, CO_NMT_OPERATIONAL = 5 } CO_NMT_internalState_t;

typedef struct { CO_NMT_internalState_t operatingState; } CO_NMT_t;
typedef struct { uint16_t sent[8]; int count; } CO_EM_t;
typedef struct { void *object; void (*signal)(void *object); } CO_HBconsumer_t;
typedef struct { int locks; } CO_CANmodule_t;

typedef struct {
    CO_CANmodule_t *CANmodule;
    CO_NMT_t *NMT;
    CO_EM_t *em;
    CO_HBconsumer_t *HBcons;
    OD_t *od;              /* of the stub, from here on */
    bool sync;             /* one has come */
    bool rpdo;             /* one has come */
    uint8_t rpdo_bytes[6]; /* controlword, target */
    uint8_t tpdo_bytes[6]; /* statusword, position, as they were sent last */
    int tpdo2_count;       /* how often TPDO2 was asked for */
} CO_t;

#define CO_EM_MANUFACTURER_START 0x30U
#define CO_LOCK_OD(module) ((module)->locks++)
#define CO_UNLOCK_OD(module) ((module)->locks--)
#define CO_errorReport(em, bit, code, info) CO_error(em, true, bit, code, info)
#define CO_errorReset(em, bit, info) CO_error(em, false, bit, 0, info)

OD_entry_t *OD_find(OD_t *od, uint16_t index);
ODR_t OD_extension_init(OD_entry_t *entry, OD_extension_t *extension);
ODR_t OD_readOriginal(OD_stream_t *stream, void *buf, OD_size_t count, OD_size_t *countRead);
ODR_t OD_get_u16(const OD_entry_t *entry, uint8_t sub, uint16_t *value, bool_t odOrig);
ODR_t OD_get_u32(const OD_entry_t *entry, uint8_t sub, uint32_t *value, bool_t odOrig);
void OD_requestTPDO(uint8_t *flagsPDO, uint8_t sub);

CO_NMT_internalState_t CO_NMT_getInternalState(CO_NMT_t *nmt);
void CO_HBconsumer_initCallbackPre(CO_HBconsumer_t *consumer, void *object,
                                   void (*signal)(void *object));
void CO_error(CO_EM_t *em, bool_t set, uint8_t bit, uint16_t code, uint32_t info);

bool_t CO_process_SYNC(CO_t *co, uint32_t dt, uint32_t *timerNext);
void CO_process_RPDO(CO_t *co, bool_t sync, uint32_t dt, uint32_t *timerNext);
void CO_process_TPDO(CO_t *co, bool_t sync, uint32_t dt, uint32_t *timerNext);

#ifdef __cplusplus
}
#endif

#endif
