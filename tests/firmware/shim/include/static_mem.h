#pragma once
void shim_create_task(void (*function)(void *));
#define STATIC_MEM_TASK_ALLOC(NAME, WORDS) _Static_assert((WORDS) > 0, #NAME)
#define STATIC_MEM_TASK_CREATE(NAME, FUNCTION, TITLE, PARAMETERS, PRIORITY) shim_create_task(FUNCTION)
