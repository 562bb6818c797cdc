/* Written for tests from what onboard/firmware/app calls: the firmware's entry points of an app. */
#pragma once
void appInit(void);
void appMain(void);
