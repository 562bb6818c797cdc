#ifndef PERCH_SHIM_TABLES_H
#define PERCH_SHIM_TABLES_H

#include "param.h"

/* The parameter with this complete name, NULL without. */
const shim_parameter *shim_find_parameter(const char *name);

int shim_parameter_size(const shim_parameter *parameter);

#endif
