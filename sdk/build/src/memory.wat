;; `memcpy` and `memset`: whole words, then the rest byte by byte. `memcpy` takes eight words
;; at once as long as it can: what each round of a loop costs, its fuel above all, is more
;; than a word's copy.
;;
;; Those of the compiler have ways of their own for each alignment, which
;; WebAssembly does not need: 1.3 kB.
(module
  (func $memcpy (param $to i32) (param $from i32) (param $left i32) (result i32) (local $at i32)
    local.get $to
    local.set $at
    block $no_blocks
      local.get $left
      i32.const 64
      i32.lt_u
      br_if $no_blocks
      loop $blocks
        local.get $at
        local.get $from
        i64.load align=1
        i64.store align=1
        local.get $at
        local.get $from
        i64.load offset=8 align=1
        i64.store offset=8 align=1
        local.get $at
        local.get $from
        i64.load offset=16 align=1
        i64.store offset=16 align=1
        local.get $at
        local.get $from
        i64.load offset=24 align=1
        i64.store offset=24 align=1
        local.get $at
        local.get $from
        i64.load offset=32 align=1
        i64.store offset=32 align=1
        local.get $at
        local.get $from
        i64.load offset=40 align=1
        i64.store offset=40 align=1
        local.get $at
        local.get $from
        i64.load offset=48 align=1
        i64.store offset=48 align=1
        local.get $at
        local.get $from
        i64.load offset=56 align=1
        i64.store offset=56 align=1
        local.get $at
        i32.const 64
        i32.add
        local.set $at
        local.get $from
        i32.const 64
        i32.add
        local.set $from
        local.get $left
        i32.const 64
        i32.sub
        local.tee $left
        i32.const 64
        i32.ge_u
        br_if $blocks
      end
    end
    block $no_words
      local.get $left
      i32.const 8
      i32.lt_u
      br_if $no_words
      loop $words
        local.get $at
        local.get $from
        i64.load align=1
        i64.store align=1
        local.get $at
        i32.const 8
        i32.add
        local.set $at
        local.get $from
        i32.const 8
        i32.add
        local.set $from
        local.get $left
        i32.const 8
        i32.sub
        local.tee $left
        i32.const 8
        i32.ge_u
        br_if $words
      end
    end
    block $none
      loop $bytes
        local.get $left
        i32.eqz
        br_if $none
        local.get $at
        local.get $from
        i32.load8_u
        i32.store8
        local.get $at
        i32.const 1
        i32.add
        local.set $at
        local.get $from
        i32.const 1
        i32.add
        local.set $from
        local.get $left
        i32.const 1
        i32.sub
        local.set $left
        br $bytes
      end
    end
    local.get $to)
  (func $memset (param $to i32) (param $byte i32) (param $left i32) (result i32)
    (local $at i32) (local $word i64)
    local.get $to
    local.set $at
    local.get $byte
    i64.extend_i32_u
    i64.const 255
    i64.and
    i64.const 0x0101010101010101
    i64.mul
    local.set $word
    block $few
      loop $words
        local.get $left
        i32.const 8
        i32.lt_u
        br_if $few
        local.get $at
        local.get $word
        i64.store align=1
        local.get $at
        i32.const 8
        i32.add
        local.set $at
        local.get $left
        i32.const 8
        i32.sub
        local.set $left
        br $words
      end
    end
    block $none
      loop $bytes
        local.get $left
        i32.eqz
        br_if $none
        local.get $at
        local.get $byte
        i32.store8
        local.get $at
        i32.const 1
        i32.add
        local.set $at
        local.get $left
        i32.const 1
        i32.sub
        local.set $left
        br $bytes
      end
    end
    local.get $to)
  (memory 1))
