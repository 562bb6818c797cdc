#include "vehicle.h"

#include "crc32.h"

uint32_t perch_vehicle_crc(const perch_vehicle *vehicle) { return perch_crc32(0, vehicle, sizeof *vehicle); }
