// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/entropy.hpp"

#include "security/keys/secret.hpp"

#include <sodium.h>

namespace cles::security {
namespace {

class system_generator final : public entropy {
  public:
    void fill(std::span<std::uint8_t> out) override { randombytes_buf(out.data(), out.size()); }
};

} // namespace

entropy& system_entropy() {
    prepare_sodium();
    static system_generator generator;
    return generator;
}

} // namespace cles::security
