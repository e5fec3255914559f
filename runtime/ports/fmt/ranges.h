#pragma once

#include "runtime/ports/fmt/format.h"
