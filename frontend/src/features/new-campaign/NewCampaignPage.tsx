import { Button, SimpleGrid, TextInput } from "@mantine/core";
import { useForm } from "@mantine/form";
import { IconPlus } from "@tabler/icons-react";
import { useSearchParams } from "wouter";
import { useCreateCampaign } from "../../api/mutations";
import { useCatalogue } from "../../api/queries";
import type { Catalogue, NewCampaign, Vehicle } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { Aside } from "../../ui/Aside";
import { SelectField } from "../../ui/Fields";
import classes from "../../ui/Form.module.css";
import { FoldedSection, FormPage, GainFields, MissingEntries, RequestForm } from "../../ui/FormPage";
import { offeredExperiments } from "../../ui/units";
import { useTitle } from "../../ui/useTitle";
import { AdvancedFields } from "./AdvancedFields";
import { DonorPicker } from "./DonorPicker";
import { advancedTitle, fieldsOf, unreadable } from "./fields";
import {
  type CampaignForm,
  choicesOf,
  gainsOf,
  openCampaign,
  presetOf,
  requestFrom,
  STARTS,
  startingForm,
  startsFor,
  strategiesFor,
  withExperiment,
  withPreset,
  withRegistered,
} from "./newCampaign";
import { VehiclePicker } from "./VehiclePicker";

/** `?vehicle=ID` preselects a registered vehicle. */
export function NewCampaignPage() {
  useTitle("New campaign");
  const catalogue = useCatalogue();
  const vehicles = useVehicles();
  const wanted = Number(useSearchParams()[0].get("vehicle"));

  return (
    <FormPage
      title="New campaign"
      error={catalogue.error ?? vehicles.error}
      isPending={catalogue.isPending || vehicles.isPending}
    >
      {catalogue.data && vehicles.data && (
        <NewCampaignForm
          catalogue={catalogue.data}
          vehicles={vehicles.data}
          wanted={vehicles.data.find(({ id, registered }) => registered && id === wanted)}
        />
      )}
    </FormPage>
  );
}

const NO_PRESET = { value: "", label: "Own settings" };

interface FormProps {
  catalogue: Catalogue;
  vehicles: readonly Vehicle[];
  wanted: Vehicle | undefined;
}

/** What is not chosen or entered yet, by field. */
function missingFrom({ name, vehicle, definition: { start } }: CampaignForm): Record<string, string> {
  return {
    ...(name.trim() === "" ? { name: "Enter a name." } : {}),
    ...(vehicle.kind === "" ? { "vehicle.kind": "Choose a vehicle." } : {}),
    ...(start.kind === "campaign" && start.donor === null ? { "definition.start.donor": "Choose a campaign." } : {}),
  };
}

function NewCampaignForm({ catalogue, vehicles, wanted }: FormProps) {
  const form = useForm<CampaignForm, NewCampaign>({
    initialValues:
      wanted === undefined ? startingForm(catalogue) : withRegistered(startingForm(catalogue), catalogue, wanted),
    transformValues: (values) => requestFrom(values, catalogue),
  });
  const create = useCreateCampaign();
  const { registered, definition } = form.values;
  const { plain, advanced } = fieldsOf(form.values, catalogue);
  const missing = missingFrom(form.values);
  const field = (path: string) => ({
    label: plain[path],
    ...form.getInputProps(path),
    error: missing[path] ?? form.errors[path],
  });

  const preset = presetOf(form.values, catalogue);
  const presets = choicesOf(catalogue.presets);
  const strategies = strategiesFor(catalogue, definition.experiment);
  const strategy = strategies.find(({ name }) => name === definition.strategy);
  const unread = unreadable(form.values, (path) => form.getInputProps(path).value, catalogue);
  const isWrongBelow =
    unread.some((label) => !(label in definition.start.gains)) ||
    Object.keys(advanced).some((path) => path in form.errors);
  return (
    <RequestForm
      form={form}
      labels={{ ...plain, ...advanced }}
      request={create}
      onDone={openCampaign}
      actions={
        <div className={classes["create"]}>
          <MissingEntries numbers={unread} texts={Object.values(missing)} />
          <Button
            type="submit"
            size="lg"
            disabled={unread.length > 0 || Object.keys(missing).length > 0}
            loading={create.isPending}
            leftSection={<IconPlus size={22} aria-hidden />}
          >
            Create campaign
          </Button>
        </div>
      }
    >
      <SelectField
        label="Preset"
        description={preset?.line}
        data={preset === undefined ? [NO_PRESET, ...presets] : presets}
        value={preset?.name ?? NO_PRESET.value}
        onChange={(value) => {
          const chosen = catalogue.presets.find(({ name }) => name === value);
          if (chosen !== undefined) form.setValues(withPreset(form.values, catalogue, chosen));
        }}
      />
      {catalogue.experiments.length > 1 && (
        <SelectField
          {...field("definition.experiment")}
          data={choicesOf(offeredExperiments(catalogue))}
          onChange={(value) => form.setValues(withExperiment(form.values, catalogue, value))}
        />
      )}
      <VehiclePicker
        form={form.values}
        catalogue={catalogue}
        vehicles={vehicles}
        error={field("vehicle.kind").error ?? form.errors["vehicle.id"]}
        onChange={form.setValues}
      />
      {registered?.is_real && (
        <Aside tone="warn">
          {registered.name} is a real vehicle. Before its first flight, the campaign must pass a rehearsal on a
          simulation, which you start from the campaign page.
        </Aside>
      )}
      <TextInput {...field("name")} maxLength={120} />
      <SimpleGrid minColWidth={260} autoFlow="auto-fit" spacing={16} style={{ alignItems: "start" }}>
        <SelectField
          {...field("definition.start.kind")}
          data={startsFor(catalogue, definition.experiment).map((value) => ({ value, label: STARTS[value] }))}
        />
        <SelectField
          {...field("definition.strategy")}
          description={`${strategies.length > 1 && strategy === strategies[0] ? "Recommended. " : ""}${strategy?.line ?? ""}`}
          data={choicesOf(strategies)}
          onChange={(value) => {
            form.setFieldValue("definition.strategy", value);
            form.setFieldValue("definition.options", {});
          }}
        />
      </SimpleGrid>
      {definition.start.kind === "campaign" && (
        <DonorPicker experiment={definition.experiment} {...field("definition.start.donor")} />
      )}
      {definition.start.kind === "given" && (
        <GainFields
          legend="Start gains"
          gains={gainsOf(catalogue, definition.experiment)}
          input={(name) => form.getInputProps(`definition.start.gains.${name}`)}
        />
      )}
      <FoldedSection title={advancedTitle(form.values, catalogue)} forcedOpen={isWrongBelow}>
        <AdvancedFields form={form} catalogue={catalogue} />
      </FoldedSection>
    </RequestForm>
  );
}
