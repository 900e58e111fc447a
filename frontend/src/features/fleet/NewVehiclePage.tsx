import { Button, Checkbox, Stack, TextInput } from "@mantine/core";
import { IconPlus } from "@tabler/icons-react";
import { useState } from "react";
import { useNavigate } from "react-router";
import { useRegistrationRefusal } from "../../api/access";
import { useRegisterVehicle } from "../../api/fleet";
import { reasonsByField, standingProblem } from "../../api/problems";
import { useCatalogue } from "../../api/queries";
import type { Catalogue } from "../../api/types";
import { VehicleBadge } from "../../ui/Badges";
import { SelectField } from "../../ui/Fields";
import classes from "../../ui/Form.module.css";
import { FormPage, GainFields, MissingEntries } from "../../ui/FormPage";
import { FormErrorNotice, ReadOnlyNotice } from "../../ui/Notices";
import { useTitle } from "../../ui/useTitle";
import {
  autopilotOf,
  gainsFor,
  isSimulated,
  startingVehicle,
  unreadGains,
  type VehicleForm,
  vehicleRequest,
  withAutopilot,
  withSimulation,
} from "./fleet";
import { AddressField, FurtherFields, furtherLabels, NameField, PLAIN_LABELS } from "./VehicleFields";

export function NewVehiclePage() {
  useTitle("Register a vehicle");
  const catalogue = useCatalogue();
  return (
    <FormPage title="Register a vehicle" error={catalogue.error} isPending={catalogue.isPending}>
      {catalogue.data && <NewVehicleForm catalogue={catalogue.data} />}
    </FormPage>
  );
}

const LABELS = {
  ...PLAIN_LABELS,
  "options.autopilot": "Autopilot",
  "options.simulated": "Simulation on this computer",
  safe_gains_confirmed: "Verified safe on this vehicle",
  statement: "Verified by, and how",
};

function NewVehicleForm({ catalogue }: { catalogue: Catalogue }) {
  const [form, setForm] = useState<VehicleForm>(() => startingVehicle(catalogue));
  const navigate = useNavigate();
  const register = useRegisterVehicle();
  const set = (change: Partial<VehicleForm>): void => setForm({ ...form, ...change });
  const setOption = (name: string, value: boolean | number | string): void =>
    set({ options: { ...form.options, [name]: value } });
  const gains = gainsFor(catalogue, autopilotOf(form));
  const labels = {
    ...LABELS,
    ...Object.fromEntries(gains.map(({ name }) => [`safe_gains.${name}`, name])),
    ...furtherLabels(catalogue),
  };
  const request = vehicleRequest(form);
  const problem = standingProblem(register.error, register.variables, request);
  const reasons = reasonsByField(problem, Object.keys(labels));
  const unread = unreadGains(form);
  const simulated = isSimulated(form);
  const refusal = useRegistrationRefusal(!simulated);
  return (
    <form
      noValidate
      className={classes["form"]}
      onSubmit={(event) => {
        event.preventDefault();
        register.mutate(request, { onSuccess: ({ id }) => void navigate(`/vehicles/${id}`) });
      }}
    >
      <ReadOnlyNotice why={refusal} />
      <NameField value={form.name} error={reasons["name"]} onChange={(name) => set({ name })} />
      <div className={classes["pair"]}>
        <SelectField
          label={LABELS["options.autopilot"]}
          data={catalogue.autopilots.map(({ name, label }) => ({ value: name, label }))}
          value={autopilotOf(form)}
          error={reasons["options.autopilot"]}
          onChange={(value) => setForm(withAutopilot(form, catalogue, value))}
        />
        <AddressField
          value={form.options["address"]}
          error={reasons["options.address"]}
          onChange={(address) => setOption("address", address)}
        />
      </div>
      <div className={classes["kind"]} data-real={!simulated || undefined}>
        <VehicleBadge isReal={!simulated} />
        <p>
          {simulated
            ? "A simulation on this computer: one click starts a flight, and its result is classified automatically."
            : "A real vehicle: the operator in control holds a button to take off, and reviews every flight."}
        </p>
        <Checkbox
          size="md"
          label={LABELS["options.simulated"]}
          checked={simulated}
          error={reasons["options.simulated"]}
          onChange={(event) => setForm(withSimulation(form, catalogue, event.currentTarget.checked))}
        />
      </div>
      <GainFields
        legend="Safe gains, restored after every flight"
        gains={gains}
        values={form.safeGains}
        reasons={reasons}
        prefix="safe_gains"
        onChange={(safeGains) => set({ safeGains, confirmed: false })}
      />
      {!simulated && (
        <Stack gap={12}>
          <Checkbox
            size="md"
            label={LABELS.safe_gains_confirmed}
            description="Confirms exactly these gains. Changing any of them clears the confirmation."
            checked={form.confirmed}
            error={reasons["safe_gains_confirmed"]}
            onChange={(event) => set({ confirmed: event.currentTarget.checked })}
          />
          <TextInput
            label={LABELS.statement}
            placeholder="A. Pilot: flown by hand this morning"
            value={form.statement}
            maxLength={500}
            error={reasons["statement"]}
            onChange={(event) => set({ statement: event.currentTarget.value })}
          />
        </Stack>
      )}
      <FurtherFields catalogue={catalogue} options={form.options} reasons={reasons} onChange={setOption} />
      <FormErrorNotice error={problem} labels={labels} />
      <MissingEntries numbers={unread} />
      <Button
        type="submit"
        size="lg"
        disabled={unread.length > 0}
        loading={register.isPending}
        leftSection={<IconPlus size={22} aria-hidden />}
        className={classes["submit"]}
      >
        Register vehicle
      </Button>
    </form>
  );
}
