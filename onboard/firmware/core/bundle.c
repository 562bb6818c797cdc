/* Reading a policy bundle: the rules of docs/policy_bundle.md, in their order. */
#include <string.h>

#include "crc32.h"
#include "policy.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "bundles are little endian, and used as they are");

enum { INPUTS = 3, ELU = 1, VERSION = 1, HEADER_BYTES = 88 };

/* Places in the bundle: in bytes, in 2 bytes, in 4 bytes. */
enum { AT_ACTIVATION = 22, AT_RESERVED = 23 };
enum { AT_VERSION = 2, AT_HEADER_BYTES = 3, AT_INPUTS = 8, AT_VECTORS = 9, AT_LAYERS = 10, AT_SIZES = 36 };
enum { AT_LENGTH = 2, AT_CRC = 3, BYTES_BEFORE_CRC = 12, BYTES_WITH_CRC = 16 };

static bool crc_is_right(const perch_bank *bank, size_t length) {
  const uint32_t before = perch_crc32(0, bank->bytes, BYTES_BEFORE_CRC);
  return perch_crc32(before, bank->bytes + BYTES_WITH_CRC, length - BYTES_WITH_CRC) == bank->words[AT_CRC];
}

/* Numbers of the network; 0 when its layers are not possible. Fills in the sizes. */
static size_t count_network(const perch_bank *bank, uint16_t layers, uint8_t sizes[]) {
  size_t numbers = 0;
  sizes[0] = INPUTS;
  for (size_t i = 0; i < PERCH_MAX_LAYERS; i++) {
    const uint16_t size = bank->halves[AT_SIZES + i];
    if (i >= layers) {
      if (size != 0) {
        return 0;
      }
      continue;
    }
    if (size < 1 || size > PERCH_MAX_WIDTH) {
      return 0;
    }
    sizes[i + 1] = (uint8_t)size;
    numbers += (size_t)size * (sizes[i] + 1u);
  }
  return sizes[layers] == 1 ? numbers : 0;
}

static perch_policy_status check_dimensions(const perch_bank *bank, size_t length, perch_policy *policy) {
  const uint16_t vectors = bank->halves[AT_VECTORS];
  const uint16_t layers = bank->halves[AT_LAYERS];
  if (bank->halves[AT_INPUTS] != INPUTS || bank->bytes[AT_ACTIVATION] != ELU || bank->bytes[AT_RESERVED] != 0) {
    return PERCH_POLICY_REFUSED_FORMAT;
  }
  if (vectors > PERCH_MAX_VECTORS) {
    return PERCH_POLICY_REFUSED_VECTORS;
  }
  if (vectors < 1 || layers < 1 || layers > PERCH_MAX_LAYERS) {
    return PERCH_POLICY_REFUSED_FORMAT;
  }
  const size_t network = count_network(bank, layers, policy->sizes);
  if (network == 0 || length != HEADER_BYTES + 4 * (4u * vectors + network)) {
    return PERCH_POLICY_REFUSED_FORMAT;
  }
  policy->vectors = vectors;
  policy->layers = (uint8_t)layers;
  return PERCH_POLICY_ACTIVE;
}

/* Whether all of `count` numbers lie within the range; no NaN does. */
static bool within(const float *numbers, size_t count, float least, float most) {
  for (size_t i = 0; i < count; i++) {
    if (!(numbers[i] >= least && numbers[i] <= most)) {
      return false;
    }
  }
  return true;
}

static bool ranges_are_right(const perch_bank *bank, size_t length, uint16_t vectors) {
  const float *n = bank->numbers;
  const size_t network = length / 4 - PERCH_AT_BODY - 4u * vectors;
  return within(n + PERCH_AT_MEAN, 3, -1e3f, 1e3f) && within(n + PERCH_AT_STD, 3, 1e-6f, 1e3f) &&
         within(n + PERCH_AT_BODY, vectors, 0.0f, 1e3f) &&
         within(n + PERCH_AT_BODY + vectors, 3u * vectors, -100.0f, 100.0f) &&
         within(n + PERCH_AT_GAMMA, 1, 0.0f, 1e3f) && n[PERCH_AT_GAMMA] > 0.0f &&
         within(n + PERCH_AT_INTERCEPT, 1, -1e3f, 0.0f) && n[PERCH_AT_INTERCEPT] < 0.0f &&
         within(n + PERCH_AT_TAU_MIN, 2, 0.0f, 10.0f) && n[PERCH_AT_TAU_MIN] < n[PERCH_AT_TAU_MAX] &&
         within(n + PERCH_AT_BODY + 4u * vectors, network, -1e4f, 1e4f) &&
         within(n + PERCH_AT_A_ROT_MIN, 2, -0.05f, 0.0f) && n[PERCH_AT_A_ROT_MIN] < n[PERCH_AT_A_ROT_MAX];
}

perch_policy_status perch_parse_bundle(const perch_bank *bank, size_t length, perch_policy *policy) {
  if (length < HEADER_BYTES || length > PERCH_MAX_BUNDLE) {
    return PERCH_POLICY_REFUSED_LENGTH;
  }
  if (memcmp(bank->bytes, "PHPB", 4) != 0 || bank->halves[AT_VERSION] != VERSION ||
      bank->halves[AT_HEADER_BYTES] != HEADER_BYTES) {
    return PERCH_POLICY_REFUSED_FORMAT;
  }
  if (bank->words[AT_LENGTH] != length) {
    return PERCH_POLICY_REFUSED_LENGTH;
  }
  if (!crc_is_right(bank, length)) {
    return PERCH_POLICY_REFUSED_CRC;
  }
  perch_policy found = {.bank = bank};
  const perch_policy_status status = check_dimensions(bank, length, &found);
  if (status != PERCH_POLICY_ACTIVE) {
    return status;
  }
  if (!ranges_are_right(bank, length, found.vectors)) {
    return PERCH_POLICY_REFUSED_RANGE;
  }
  found.crc = perch_crc32(0, bank->bytes, length);
  *policy = found;
  return PERCH_POLICY_ACTIVE;
}

float perch_tau_min(const perch_policy *policy) { return policy->bank->numbers[PERCH_AT_TAU_MIN]; }

const float *perch_dual_coefficients(const perch_policy *policy) { return policy->bank->numbers + PERCH_AT_BODY; }

const float *perch_support_vectors(const perch_policy *policy) {
  return perch_dual_coefficients(policy) + policy->vectors;
}

const float *perch_layer_numbers(const perch_policy *policy) {
  return perch_support_vectors(policy) + 3u * policy->vectors;
}
