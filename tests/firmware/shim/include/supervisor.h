#pragma once
#include <stdbool.h>
bool supervisorIsFlying(void);
bool supervisorIsArmed(void);
bool supervisorRequestArming(bool doArm);
