# make            builds build/oneray
# make demo       sets up what is missing, renders and verifies the canonical scenes, leaves build/report/index.html; says
#                 first how long that is
# make test       sets up what is missing and runs all tests
# make references renders the references anew with Mitsuba;  make thorough  verifies with many samples
# make techniques measures what each technique costs in each scene, five minutes, into references/techniques.json
# make report     races all techniques and Mitsuba's two variants in every scene for twelve minutes, leaves build/report/index.html
# make stability  how far both renderers hold in stiff cases, ten minutes, into references/stability.json and precisions.json
# make lecture    the lecture's techniques as a page that renders while one reads it: build/lecture/index.html, offline
# make benchmark  measures speed and variance beside Mitsuba and how cost grows, twenty minutes, into references/benchmark.json
# make audit      judges other renderers by closed forms, fifteen minutes, and says what changed against references/audit.json;
#                 Cycles, LuxCore and Raysect come by pip into ~/.cache/raycheck-audit (RAYCHECK_AUDIT=FOLDER)
# make calibrate  measures raycheck itself, three hours of one core, into references/calibration.json, signatures, parts and harness_mutants.json
#                 of these only what is stale: python scripts/stale.py --measure
# make fuzz       feeds broken scenes, PLY, OBJ and serialized files to their readers, an hour each (FUZZ_SECONDS=3600), with clang
# make install    puts oneray into PREFIX/bin (PREFIX=/usr/local, DESTDIR in front);  make wheel  wheels of both into dist
# make KERNELS=generic LANES=native   one general kernel at the machine's own width, in seconds, for experiments
# make WERROR=1   stops at a warning, as make test does;  make V=1  shows each command whole

BUILD   ?= build
CC      ?= cc
# -ffp-contract=off: the same bits whether or not the processor has fused multiply-add.
# -fno-math-errno, -fno-trapping-math: no result changes; sqrt needs no call, a select needs no branch.
CFLAGS  ?= -O2 -g
WARN    := -Wall -Wextra -pedantic -Wconversion -Wshadow $(if $(WERROR),-Werror)
# The same bits also want every operation to round to the type of its operands, FLT_EVAL_METHOD 0: on 32-bit x86 by SSE,
# on s390x by a gcc that does not promote.
method = $(shell echo __FLT_EVAL_METHOD__ | $(CC) -std=c99 $(CFLAGS) $(1) -E -P -x c - 2>/dev/null)
ROUNDS := $(if $(filter-out 0,$(method)),$(if $(filter 0,$(call method,-msse2 -mfpmath=sse)),-msse2 -mfpmath=sse,$(if \
    $(filter 0,$(call method,-fexcess-precision=fast)),-fexcess-precision=fast)))
ifneq (,$(filter-out 0,$(call method,$(ROUNDS))))
$(error $(CC) $(CFLAGS) keeps more digits than a number has (FLT_EVAL_METHOD is not 0): another processor or compiler is wanted)
endif
# expat: the XML parser; zlib: serialized meshes; OpenEXR (its C library, OpenEXRCore) and libpng: the pictures. What a scene
# names in other formats is read by stb_image, a header.
PACKAGES := expat zlib OpenEXR libpng
ALL_CFLAGS = -std=c99 -D_XOPEN_SOURCE=700 -Isrc/oneray -I$(BUILD) $(WARN) -ffp-contract=off -fno-math-errno \
    -fno-trapping-math $(CFLAGS) $(ROUNDS)
PKG_CFLAGS := $(patsubst -I%,-isystem %,$(shell pkg-config --cflags $(PACKAGES) 2>/dev/null))

# A kernel: precision:lanes:level, level 0 for any processor of this architecture, 1 for AVX2, 2 for AVX-512; with
# :special, the instances of instances.c beside the generic one. Those for AVX-512 only where it is there.
MACHINE := $(shell $(CC) -dumpmachine 2>/dev/null)
ifneq (,$(findstring x86_64,$(MACHINE)))
CPU_FLAGS := $(shell grep -m1 '^flags' /proc/cpuinfo 2>/dev/null)
SPECIAL_2 := $(if $(filter avx512dq,$(CPU_FLAGS)),:special)
KERNEL_LIST := double:8:2$(SPECIAL_2) double:4:1:special double:2:0 double:1:0 \
    single:16:2$(SPECIAL_2) single:8:1:special single:4:0 single:1:0
FLAGS_1 := -march=x86-64-v3
FLAGS_2 := -march=x86-64-v4
NATIVE := $(if $(filter avx512dq,$(CPU_FLAGS)),double:8:2:special single:16:2:special,$(if \
    $(filter avx2,$(CPU_FLAGS)),double:4:1:special single:8:1:special,double:2:0:special single:4:0:special))
else
KERNEL_LIST := double:2:0:special double:1:0 single:4:0:special single:1:0
NATIVE := double:2:0:special single:4:0:special
endif
ifeq ($(LANES),native)
KERNEL_LIST := $(NATIVE)
endif
ifeq ($(KERNELS),generic)
KERNEL_LIST := $(KERNEL_LIST:%:special=%)
endif

part = $(word $(2),$(subst :, ,$(1)))
SOURCES := $(wildcard src/oneray/*.c src/oneray/*/*.c)
# kinds/FOLDER.h includes the file of each kind of the list FOLDER in kinds.h that has one.
KIND_HEADERS := $(foreach f,materials shapes emitters textures media filters sensors estimators,$(BUILD)/kinds/$(f).h)
SOURCE_HEADERS := $(wildcard src/oneray/*.h src/oneray/*/*.h)
HEADERS := $(SOURCE_HEADERS) $(KIND_HEADERS)
vpath %.c $(sort $(dir $(SOURCES)))
PLAIN_OBJECTS := $(patsubst %.c,$(BUILD)/%.o,$(filter-out kernel.c instances.c,$(notdir $(SOURCES))))
name_of = $(call part,$(1),1)_$(call part,$(1),2)
KERNEL_OBJECTS := $(foreach k,$(KERNEL_LIST),$(BUILD)/kernel_$(call name_of,$(k)).o \
    $(if $(call part,$(k),4),$(BUILD)/instances_$(call name_of,$(k)).o))
KERNEL_TABLE := $(foreach k,$(KERNEL_LIST),X($(call part,$(k),1),$(call part,$(k),2),$(call part,$(k),3)))

# A line says what is compiled; with V=1 the command does.
run = $(if $(V),,@printf '  %-4s %s\n' $(1) '$(2)' && )

.PHONY: all kinds install wheel demo test references thorough techniques report stability lecture benchmark audit calibrate fuzz fuzzers clean FORCE
all: $(BUILD)/oneray

$(BUILD)/oneray: $(PLAIN_OBJECTS) $(KERNEL_OBJECTS)
	$(call run,LINK,$@)$(CC) $(CFLAGS) -o $@ $^ $(LDFLAGS) $(shell pkg-config --libs $(PACKAGES)) -lm

kinds: $(KIND_HEADERS)
$(BUILD)/kinds/%.h: $(SOURCE_HEADERS) Makefile
	@mkdir -p $(@D)
	@list=$$(echo $* | tr a-z A-Z); \
	for name in $$(printf '#include "kinds.h"\n#define X(NAME, name, words) name\nnames: %s(X)\n' $$list | \
	    $(CC) -E -P -Isrc/oneray -x c - | sed -n 's/^names://p'); do \
	    ! test -e src/oneray/$*/$$name.h || echo "#include \"$*/$$name.h\""; \
	done > $@

# Other settings than last time build everything anew.
SETTINGS := $(CC) $(ALL_CFLAGS) $(KERNEL_LIST)
$(BUILD)/.settings: FORCE | $(BUILD)
	@echo '$(SETTINGS)' | cmp -s - $@ || echo '$(SETTINGS)' > $@
FORCE:

$(BUILD)/%.o: %.c $(HEADERS) Makefile $(BUILD)/.settings | $(BUILD)
	$(call run,CC,$<)$(CC) $(ALL_CFLAGS) $(PKG_CFLAGS) -D'KERNELS(X)=$(KERNEL_TABLE)' -c $< -o $@

# -g1: lines, but no variables, whose tracking takes a sixth of the build.
define kernel_rule
$$(BUILD)/%_$(call name_of,$(1)).o: src/oneray/kernel/%.c $$(HEADERS) Makefile $$(BUILD)/.settings | $$(BUILD)
	$$(call run,CC,$$< $(1))$$(CC) $$(ALL_CFLAGS) $$(if $$(findstring -g,$$(CFLAGS)),-g1) $$(FLAGS_$(call part,$(1),3)) \
	    $(if $(filter single:%,$(1)),-DSINGLE) -DLANES=$(call part,$(1),2) -DKERNEL=kernel_$(call name_of,$(1)) \
	    $(if $(call part,$(1),4),-DINSTANCES=instances_$(call name_of,$(1))) \
	    $$(if $$(filter instances,$$*),-DSPECIALISED) -c $$< -o $$@
endef
$(foreach k,$(KERNEL_LIST),$(eval $(call kernel_rule,$(k))))

$(BUILD):
	mkdir -p $@

PREFIX ?= /usr/local
install: $(BUILD)/oneray
	install -D $< $(DESTDIR)$(PREFIX)/bin/oneray

wheel: $(BUILD)/oneray $(PYTHON)
	$(PYTHON) -m pip wheel --quiet --no-deps -w dist .
	$(PYTHON) -m pip wheel --quiet --no-deps -w dist -Ccmake.define.ONERAY=$(abspath $<) ./src/oneray

# ---- oneray as WebAssembly, for the lecture's pages: by clang with lld, wasi-libc and compiler-rt of Debian (scripts/setup.sh).
# Without pictures and packed meshes (src/wasm/left_out.c), with a small XML parser in expat's place.
WASM_CC ?= clang-19
WASM_PACKAGES := lld-19 wasi-libc libclang-rt-19-dev-wasm32
WASM := $(BUILD)/wasm
WASM_KERNELS := double:2 single:4
WASM_FLAGS := --target=wasm32-wasi -std=c99 -D_XOPEN_SOURCE=700 -O2 -msimd128 -ffp-contract=off -fno-math-errno \
    -fno-trapping-math -isystem src/wasm/include -Isrc/oneray -I$(BUILD) $(WARN) -Wno-sign-conversion -Wno-shorten-64-to-32
WASM_SOURCES := $(wildcard src/wasm/*.c) $(filter-out %/kernel.c %/instances.c %/exr.c %/picture.c %/output.c %/image.c %/openexr.c \
    %/serialized.c %/stats.c,$(SOURCES))
WASM_OBJECTS := $(WASM_SOURCES:src/%.c=$(WASM)/%.o) $(foreach k,$(WASM_KERNELS),$(WASM)/kernel_$(call name_of,$(k)).o)
$(WASM)/%.o: src/%.c $(HEADERS) $(wildcard src/wasm/include/*.h) Makefile
	@mkdir -p $(@D)
	$(call run,WASM,$<)$(WASM_CC) $(WASM_FLAGS) -D'KERNELS(X)=$(foreach k,$(WASM_KERNELS),X($(call part,$(k),1),$(call part,$(k),2),0))' \
	    -c $< -o $@
$(WASM)/kernel_%.o: src/oneray/kernel/kernel.c $(HEADERS) $(wildcard src/wasm/include/*.h) Makefile
	@mkdir -p $(@D)
	$(call run,WASM,$< $*)$(WASM_CC) $(WASM_FLAGS) $(if $(findstring single,$*),-DSINGLE) -DLANES=$(lastword $(subst _, ,$*)) \
	    -DKERNEL=kernel_$* -c $< -o $@
$(WASM)/oneray.wasm: $(WASM_OBJECTS)
	$(call run,LINK,$@)$(WASM_CC) --target=wasm32-wasi -O2 -Wl,--strip-all -Wl,-z,stack-size=1048576 -o $@ $^

# ---- libFuzzer targets of the readers, under AddressSanitizer and UndefinedBehaviorSanitizer.
FUZZ_SECONDS ?= 3600
FUZZERS := $(foreach f,scene ply obj serialized,$(BUILD)/fuzz/$(f))
FUZZ_CFLAGS := -std=c99 -D_XOPEN_SOURCE=700 $(WARN) -O1 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all \
    -Isrc/oneray -I$(BUILD) $(PKG_CFLAGS) -include tests/fuzz/harness.h
stems = $(basename $(notdir $(wildcard src/oneray/$(1)/*.c)))
FUZZ_MESH := harness message rounded text $(call stems,meshes)
FUZZ_SCENE := $(FUZZ_MESH) $(call stems,trees) $(call stems,images) $(call stems,scene)
vpath %.c tests/fuzz

$(BUILD)/fuzz/%.o: %.c $(HEADERS) tests/fuzz/harness.h Makefile
	@mkdir -p $(@D)
	clang $(FUZZ_CFLAGS) -c $< -o $@
FUZZ_READER = $(if $(filter serialized,$(1)),serialized_fuzz,$(1)_read)
$(BUILD)/fuzz/read_ply.o $(BUILD)/fuzz/read_obj.o $(BUILD)/fuzz/read_serialized.o: $(BUILD)/fuzz/read_%.o: tests/fuzz/read_mesh.c $(HEADERS) tests/fuzz/harness.h Makefile
	@mkdir -p $(@D)
	clang $(FUZZ_CFLAGS) "-DREAD=$(call FUZZ_READER,$*)" -c $< -o $@
$(BUILD)/fuzz/ply $(BUILD)/fuzz/obj $(BUILD)/fuzz/serialized: $(BUILD)/fuzz/%: $(BUILD)/fuzz/read_%.o $(FUZZ_MESH:%=$(BUILD)/fuzz/%.o)
	clang -fsanitize=fuzzer,address,undefined -o $@ $^ -lexpat -lz -lm
$(BUILD)/fuzz/scene: $(BUILD)/fuzz/read_scene.o $(FUZZ_SCENE:%=$(BUILD)/fuzz/%.o)
	clang -fsanitize=fuzzer,address,undefined -o $@ $^ $(shell pkg-config --libs $(PACKAGES)) -lm

fuzzers: $(FUZZERS)
# What is found goes to build/fuzz/NAME.found; a crash, and an input that takes 10 s or 2 GB, ends it with its file.
fuzz: $(FUZZERS:%=%.run)
$(BUILD)/fuzz/%.run: $(BUILD)/fuzz/%
	mkdir -p $(BUILD)/fuzz/$*.found
	$< -max_total_time=$(FUZZ_SECONDS) -max_len=16384 -timeout=10 -close_fd_mask=1 -print_final_stats=1 \
	    -artifact_prefix=$(BUILD)/fuzz/$*- $(patsubst %,-dict=%,$(wildcard tests/fuzz/$*.dict)) $(BUILD)/fuzz/$*.found \
	    tests/fuzz/$* tests/malformed tests/meshes scenes

# ---- What the targets below need is set up when it is missing: system packages, then Python packages in .venv.
VENV   := .venv
PYTHON := $(VENV)/bin/python
RAYCHECK := $(VENV)/bin/raycheck

$(BUILD)/.system: scripts/setup.sh | $(BUILD)
	scripts/setup.sh
	touch $@
$(BUILD)/.system-test: scripts/setup.sh | $(BUILD)
	scripts/setup.sh clang clang-19 libclang-rt-dev $(WASM_PACKAGES) patch libllvm19 valgrind chromium bubblewrap g++
	touch $@
$(BUILD)/.system-wasm: scripts/setup.sh | $(BUILD)
	scripts/setup.sh clang-19 $(WASM_PACKAGES)
	touch $@
$(PYTHON): | $(BUILD)/.system
	python3 -m venv $(VENV)
	$(PYTHON) -m pip install --quiet --upgrade pip
$(VENV)/.demo: pyproject.toml | $(PYTHON)
	$(PYTHON) -m pip install --quiet -e .
	touch $@
$(VENV)/.lecture: pyproject.toml | $(PYTHON)
	$(PYTHON) -m pip install --quiet -e '.[lecture]'
	touch $@
$(VENV)/.test: pyproject.toml | $(PYTHON)
	$(PYTHON) -m pip install --quiet -e '.[mitsuba,lecture,test]'
	command -v chromium >/dev/null || $(PYTHON) -m playwright install --with-deps chromium
	touch $@

# A fresh machine may lack what the build asks for by name, so the build is a make of its own after the set-up, on all
# cores unless this one was told how many.
ALL = $(MAKE) $(1) $(if $(findstring -j,$(MAKEFLAGS)),,-j$(shell nproc 2>/dev/null || echo 1)) all
# The quick verification: 1 is a FAIL; 3, INCONCLUSIVE, is not. In half the time, more is INCONCLUSIVE.
VERIFY = $(RAYCHECK) verify --seconds $(1) --json $(BUILD)/verification.json $(2) || test $$? -eq 3

.PHONY: plan
plan:
	@echo "make demo: sets up what is missing, builds oneray, verifies every technique (a minute and a half), and writes"
	@echo "$(BUILD)/report/index.html (a minute). About five minutes the first time, three later. Ctrl-C is safe."
demo: plan $(BUILD)/.system $(VENV)/.demo
	+$(ALL)
	$(call VERIFY,90,--html $(BUILD)/report/verdicts)
	$(RAYCHECK) report --seconds 0 --verification $(BUILD)/verification.json -o $(BUILD)/report
	@echo "Open $(BUILD)/report/index.html"

test: $(BUILD)/.system-test $(BUILD)/.system $(VENV)/.test
	+$(call ALL,WERROR=1)
	$(call VERIFY,45)
	$(PYTHON) -m ruff check src scripts tests
	$(PYTHON) -m mypy
	$(PYTHON) -m pytest -n 2 --dist loadfile

references: $(BUILD)/.system-test $(VENV)/.test
	$(PYTHON) scripts/make_references.py
	$(RAYCHECK) reference --closed-forms

thorough: $(BUILD)/.system $(VENV)/.demo
	+$(ALL)
	$(RAYCHECK) verify --thorough --resume --json references/verification.json

techniques: $(BUILD)/.system $(VENV)/.demo
	+$(ALL)
	$(RAYCHECK) techniques --json references/techniques.json
	$(PYTHON) scripts/readme.py

# Error against run time: Ctrl-C and `make report` again go on where it was.
report: $(BUILD)/.system-test $(VENV)/.test
	+$(ALL)
	$(RAYCHECK) report --against mitsuba --seconds 2 --minutes 12 --verification references/verification.json \
	    -o $(BUILD)/report --json references/error_curves.json
	$(PYTHON) scripts/make_plots.py
	@echo "Open $(BUILD)/report/index.html"

stability: $(BUILD)/.system-test $(VENV)/.test
	+$(ALL)
	$(RAYCHECK) stability --json references/stability.json
	$(PYTHON) scripts/precisions.py --json references/precisions.json
	$(PYTHON) scripts/readme.py

lecture: $(BUILD)/.system $(BUILD)/.system-wasm $(VENV)/.lecture
	$(PYTHON) scripts/make_lecture.py -o $(BUILD)/lecture
	@echo "Open $(BUILD)/lecture/index.html"

benchmark: $(BUILD)/.system-test $(VENV)/.test
	+$(ALL)
	$(PYTHON) scripts/benchmark.py --json references/benchmark.json
	$(PYTHON) scripts/readme.py

# Exit status 1: something changed; with a newer renderer, `scripts/audit.py setup cycles --package bpy==…` before.
audit: $(BUILD)/.system-test $(VENV)/.test
	+$(ALL)
	for name in cycles luxcore raysect; do \
	    test -d "$${RAYCHECK_AUDIT:-$$HOME/.cache/raycheck-audit}/$$name" || $(PYTHON) scripts/audit.py setup $$name; done
	$(PYTHON) scripts/audit.py run --json $(BUILD)/audit.json --against references/audit.json

calibrate: $(BUILD)/.system-test $(VENV)/.test
	$(RAYCHECK) calibrate nulls
	$(RAYCHECK) calibrate mde
	$(RAYCHECK) calibrate looks
	$(RAYCHECK) calibrate mutants
	$(RAYCHECK) calibrate signatures
	$(RAYCHECK) calibrate parts
	$(RAYCHECK) calibrate naming
	$(RAYCHECK) calibrate unseen
	$(RAYCHECK) calibrate gradings --assignment docs/lecture12.toml
	$(PYTHON) scripts/mutate_harness.py --json references/harness_mutants.json
	$(PYTHON) scripts/readme.py

clean:
	rm -rf $(BUILD)
