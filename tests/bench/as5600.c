// A sketch for an Uno run in simavr, on whose I2C bus an AS5600 answers: as5600 FIRMWARE.elf ANGLES BYTES
//
// ANGLES is a file of the sensor's raw angle (0 to 4095), one line for each millisecond; -1 for a sensor that is not
// there. What the sketch sends by its serial port goes to the standard output, as it is.

#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>

enum { ADDRESS = 0x36, STATUS = 0x0B, RAW_ANGLE = 0x0C, CYCLES_PER_MS = 16000, MOST = 100000 };

static avr_t *uno;
static avr_irq_t *to_uno;
static int angles[MOST], known, selected, next;

static int angle(void) {
  long now = uno->cycle / CYCLES_PER_MS;
  return angles[now < known ? now : known - 1];
}

static int value(int where) {
  if (where == STATUS) return 0x20;  // a magnet is there
  return where == RAW_ANGLE ? angle() >> 8 : where == RAW_ANGLE + 1 ? angle() & 255 : 0;
}

static void answer(struct avr_irq_t *irq, uint32_t sent, void *none) {
  avr_twi_msg_irq_t message = {.u.v = sent};
  avr_twi_msg_t heard = message.u.twi;
  if (heard.msg & TWI_COND_STOP) selected = 0;
  if (heard.msg & TWI_COND_START) {
    selected = heard.addr >> 1 == ADDRESS && angle() >= 0;
    if (selected) avr_raise_irq(to_uno, avr_twi_irq_msg(TWI_COND_ACK, heard.addr, 1));
  } else if (selected && heard.msg & TWI_COND_WRITE) {
    next = heard.data;
    avr_raise_irq(to_uno, avr_twi_irq_msg(TWI_COND_ACK, heard.addr, 1));
  } else if (selected && heard.msg & TWI_COND_READ) {
    avr_raise_irq(to_uno, avr_twi_irq_msg(TWI_COND_READ, heard.addr, value(next++)));
  }
}

static void heard(struct avr_irq_t *irq, uint32_t byte, void *none) { putchar(byte); }

int main(int count, char **words) {
  elf_firmware_t firmware = {0};
  if (count != 3 || elf_read_firmware(words[1], &firmware)) return 2;
  FILE *file = fopen(words[2], "r");
  while (file && known < MOST && fscanf(file, "%d", &angles[known]) == 1) known++;
  if (!known || !(uno = avr_make_mcu_by_name("atmega328p"))) return 2;
  avr_init(uno);
  uno->frequency = 16000000;
  avr_load_firmware(uno, &firmware);
  uno->frequency = 16000000;
  uint32_t flags = 0;
  avr_ioctl(uno, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
  avr_irq_register_notify(avr_io_getirq(uno, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), heard, NULL);
  to_uno = avr_io_getirq(uno, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT);
  avr_irq_register_notify(avr_io_getirq(uno, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_OUTPUT), answer, NULL);
  while (uno->cycle < (avr_cycle_count_t)known * CYCLES_PER_MS)
    if (avr_run(uno) >= cpu_Done) return 1;
  return 0;
}
