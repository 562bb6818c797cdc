/* What fuzzers share: numbers, floats with those that are none, bundles near a good one; the states that they reached. */
#ifndef PERCH_DRAW_H
#define PERCH_DRAW_H

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "crc32.h"
#include "landing.h"
#include "policy.h"

static uint64_t random_state;
static perch_bank good;
static uint32_t good_length;

/* xorshift64* (Vigna 2016). */
static inline uint32_t random_word(void) {
  random_state ^= random_state >> 12;
  random_state ^= random_state << 25;
  random_state ^= random_state >> 27;
  return (uint32_t)((random_state * 0x2545F4914F6CDD1Dull) >> 32);
}

static inline uint32_t below(uint32_t n) { return random_word() % n; }

static inline float random_float(float scale) {
  static const float SPECIAL[] = {0.0f, -0.0f, 1e-30f, 3e38f, -3e38f, INFINITY, -INFINITY, NAN};
  if (below(50) == 0) {
    return SPECIAL[below(8)];
  }
  return scale * ((float)random_word() / 2147483648.0f - 1.0f);
}

static inline void require(bool holds, const char *what, uint32_t number) {
  if (!holds) {
    fprintf(stderr, "case %u: %s\n", (unsigned)number, what);
    exit(1);
  }
}

static inline void seal(perch_bank *bank, uint32_t length) {
  const uint32_t before = perch_crc32(0, bank->bytes, 12);
  bank->words[3] = perch_crc32(before, bank->bytes + 16, length - 16);
}

/* The good bundle with bytes changed, and mostly a checksum that fits; gives its length. */
static inline uint32_t spoil(perch_bank *bank) {
  uint32_t length = good_length;
  memcpy(bank, &good, sizeof good);
  for (uint32_t i = below(4); i > 0; i--) {
    const uint32_t place = below(2) ? below(88) : below(length);
    bank->bytes[place] = (uint8_t)(below(2) ? random_word() : bank->bytes[place] ^ (1u << below(8)));
  }
  if (below(4) == 0) {
    length = below(PERCH_MAX_BUNDLE + 64);
    if (below(2) && length <= PERCH_MAX_BUNDLE) {
      bank->words[2] = length;
    }
  }
  if (below(4) != 0 && length >= 16 && length <= PERCH_MAX_BUNDLE) {
    seal(bank, length);
  }
  return length;
}

/* Read the good bundle from a file, and begin with a seed. */
static inline bool begin_drawing(const char *bundle, const char *seed) {
  FILE *file = fopen(bundle, "rb");
  if (file == NULL) {
    return false;
  }
  good_length = (uint32_t)fread(good.bytes, 1, sizeof good, file);
  fclose(file);
  random_state = strtoull(seed, NULL, 10) * 2 + 1;
  return true;
}

/* How often the landing machine was in each of its states: what was drawn must have reached them. */
static inline void print_states(const uint32_t states[PERCH_FAULT + 1]) {
  for (int i = 0; i <= PERCH_FAULT; i++) {
    printf("%u ", (unsigned)states[i]);
  }
  printf("\n");
}

#endif
