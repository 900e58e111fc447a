import { Button, Checkbox, SimpleGrid, Stack, TextInput } from "@mantine/core";
import { useForm } from "@mantine/form";
import { IconPlus } from "@tabler/icons-react";
import { navigate } from "wouter/use-browser-location";
import { useRegistrationRefusal } from "../../api/access";
import { useRegisterVehicle } from "../../api/fleet";
import { useCatalogue } from "../../api/queries";
import type { Catalogue } from "../../api/types";
import { VehicleBadge } from "../../ui/Badges";
import { type NumberEntry, SelectField } from "../../ui/Fields";
import classes from "../../ui/Form.module.css";
import { FormPage, GainFields, MissingEntries, RequestForm } from "../../ui/FormPage";
import { ReadOnlyNotice } from "../../ui/Notices";
import { useTitle } from "../../ui/useTitle";
import {
  autopilotOf,
  gainsFor,
  startingVehicle,
  unreadGains,
  vehicleRequest,
  withAutopilot,
  withUsualAddress,
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
  const form = useForm({ initialValues: startingVehicle(catalogue), transformValues: vehicleRequest });
  const register = useRegisterVehicle();
  const { options } = form.values;
  const autopilot = autopilotOf(form.values);
  const gains = gainsFor(catalogue, autopilot);
  const unread = unreadGains(form.values);
  const simulated = options["simulated"] === true;
  return (
    <RequestForm
      form={form}
      labels={{
        ...LABELS,
        ...Object.fromEntries(gains.map(({ name }) => [`safe_gains.${name}`, name])),
        ...furtherLabels(catalogue),
      }}
      request={register}
      onDone={({ id }) => navigate(`/vehicles/${id}`)}
      actions={
        <>
          <MissingEntries numbers={unread} />
          <Button
            type="submit"
            size="lg"
            disabled={unread.length > 0}
            loading={register.isPending}
            leftSection={<IconPlus size={22} aria-hidden />}
            ms="auto"
          >
            Register vehicle
          </Button>
        </>
      }
    >
      <ReadOnlyNotice why={useRegistrationRefusal(!simulated)} />
      <NameField {...form.getInputProps("name")} />
      <SimpleGrid minColWidth={260} autoFlow="auto-fit" spacing={16}>
        <SelectField
          label={LABELS["options.autopilot"]}
          data={catalogue.autopilots.map(({ name, label }) => ({ value: name, label }))}
          {...form.getInputProps("options.autopilot")}
          onChange={(value) => form.setValues(withAutopilot(form.values, catalogue, value))}
        />
        <AddressField {...form.getInputProps("options.address")} />
      </SimpleGrid>
      <Stack gap={10} align="start" className={classes["kind"]} mod={{ real: !simulated }}>
        <VehicleBadge isReal={!simulated} />
        <p>
          {simulated
            ? "A simulation on this computer: one click starts a flight, and its result is classified automatically."
            : "A real vehicle: the operator in control holds a button to take off, and reviews every flight."}
        </p>
        <Checkbox
          size="md"
          label={LABELS["options.simulated"]}
          {...form.getInputProps("options.simulated", { type: "checkbox" })}
          onChange={(event) => {
            const chosen = { ...options, simulated: event.currentTarget.checked };
            form.setValues({ options: withUsualAddress(catalogue, chosen) });
          }}
        />
      </Stack>
      <GainFields
        legend="Safe gains, restored after every flight"
        gains={gains}
        input={(name) => ({
          ...form.getInputProps(`safe_gains.${name}`),
          onChange: (value: NumberEntry) => {
            form.setFieldValue(`safe_gains.${name}`, value);
            form.setFieldValue("safe_gains_confirmed", false);
          },
        })}
      />
      {!simulated && (
        <Stack gap={12}>
          <Checkbox
            size="md"
            label={LABELS.safe_gains_confirmed}
            description="Confirms exactly these gains. Changing any of them clears the confirmation."
            {...form.getInputProps("safe_gains_confirmed", { type: "checkbox" })}
          />
          <TextInput
            label={LABELS.statement}
            placeholder="A. Pilot: flown by hand this morning"
            maxLength={500}
            {...form.getInputProps("statement")}
          />
        </Stack>
      )}
      <FurtherFields
        catalogue={catalogue}
        autopilot={autopilot}
        input={(option) => form.getInputProps(`options.${option}`)}
      />
    </RequestForm>
  );
}
