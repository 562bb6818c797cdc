#pragma once
#include <stdbool.h>
int crtpCommanderHighLevelStop(void);
int crtpCommanderHighLevelGoTo2(float x, float y, float z, float yaw, float duration_s, bool relative, bool linear);
