#pragma once
#include <stdint.h>
uint32_t xTaskGetTickCount(void);
/* Leaves the running task for so many ms; in the shim, until the test lets it go on. */
void vTaskDelay(uint32_t ticks);
